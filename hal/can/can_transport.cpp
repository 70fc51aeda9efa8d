#include "hal/can/can_transport.hpp"

namespace stageid {

const char* to_string(CanBusState state) noexcept {
  switch (state) {
    case CanBusState::active:
      return "error active";
    case CanBusState::warning:
      return "error warning";
    case CanBusState::passive:
      return "error passive";
    case CanBusState::off:
      return "bus off";
    case CanBusState::down:
      return "interface down";
  }
  return "unknown";
}

WorstBus worst_bus(const CanTransport& transport) noexcept {
  WorstBus worst;
  for (std::size_t bus = 0; bus < transport.buses(); ++bus)
    if (transport.health(bus).state > worst.state) worst = {transport.health(bus).state, bus};
  return worst;
}

}  // namespace stageid
