#include "tools/measure/can_backend.hpp"

#include <string>
#include <vector>

#include "hal/can/can_bus_load.hpp"
#include "hal/can/can_resident_stage.hpp"
#include "hal/can/can_socket.hpp"
#include "hal/can/can_zeromq.hpp"

namespace stageid {
namespace {

std::unique_ptr<CanTransport> open_buses(const CanSpec& spec, const CanLayout& layout) {
  if (is_zeromq(spec.buses.front().interface))
    return std::make_unique<ZeroMqCan>(spec.buses.front().interface);
  std::vector<std::string> interfaces;
  for (const CanBusSpec& bus : spec.buses) interfaces.push_back(bus.interface);
  return std::make_unique<SocketCan>(interfaces, can_host_identifiers(layout));
}

}  // namespace

std::unique_ptr<CyclicStage> make_can_stage(const StageConfig& config,
                                            const CanHostOptions& options) {
  const CanSpec& spec = config.can.spec;
  const StageInfo& info = config.spec.info;
  const CanLayout layout = can_layout(spec, info);
  require_bus_carries(spec, layout, info.sample_rate_hz);  // before an interface is opened
  auto stage = std::make_unique<CanStage>(info, spec, open_buses(spec, layout), options);
  stage->connect();
  return stage;
}

std::unique_ptr<ResidentStage> make_can_resident_stage(const StageConfig& config,
                                                       const CanHostOptions& options) {
  const CanSpec& spec = config.can.spec;
  const StageInfo& info = config.spec.info;
  auto stage = std::make_unique<CanResidentStage>(
      info, spec, open_buses(spec, can_layout(spec, info)), options);
  stage->connect();
  return stage;
}

}  // namespace stageid
