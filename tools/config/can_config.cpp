#include "tools/config/can_config.hpp"

#include <algorithm>
#include <numeric>

#include "acquisition/files/fail.hpp"
#include "hal/can/can_zeromq.hpp"

namespace stageid {
namespace {

constexpr double kRangePerLimit = 1.25;
constexpr double kLeastWatchdog_s = 20e-3;

void describe_bus(ConfigVisitor& v, std::vector<CanFile::Bus>& list) {
  CanFile::Bus bus;
  v.text("interface", bus.spec.interface, kRequired,
         "name of the interface on host and node, such as can0; with mode: resident also "
         "tcp://HOST:PORT, a node behind ZeroMQ");
  v.number(
      "nominal_bit_rate_hz", bus.spec.nominal_bit_rate_hz, positive("bit/s"), kOptional,
      "bit rate of the arbitration phase, used for the bus load only; 'ip link' sets the real one");
  v.number("data_bit_rate_hz", bus.spec.data_bit_rate_hz, positive("bit/s"), kOptional,
           "bit rate of the data phase, used for the bus load only");
  v.texts("actuators", bus.actuators, {}, kOptional, "names; omitted with a single bus: all");
  v.texts("sensors", bus.sensors, {}, kOptional, "names; omitted with a single bus: all");
  list.push_back(std::move(bus));
}

std::vector<int> channel_numbers(const std::vector<std::string>& names,
                                 const std::vector<Channel>& channels, bool all,
                                 const std::string& interface) {
  std::vector<int> numbers;
  if (names.empty() && all) {
    numbers.resize(channels.size());
    std::iota(numbers.begin(), numbers.end(), 0);
  }
  for (const std::string& name : names) {
    const int index = channel_index(channels, name);
    if (index < 0)
      fail_request("can: bus {}: unknown channel '{}'; use a channel name of this file", interface,
                   name);
    numbers.push_back(index);
  }
  return numbers;
}

std::vector<double> ranges(const std::vector<double>& given, const Eigen::VectorXd& limits,
                           std::size_t channels, const char* key) {
  if (given.size() == channels) return given;
  if (given.size() == 1) return std::vector<double>(channels, given.front());
  if (!given.empty())
    fail_request("can: {}: got {} entries for {} channels; write 1 or {}", key, given.size(),
                 channels, channels);
  if (limits.size() != static_cast<Eigen::Index>(channels) || !limits.allFinite())
    fail_request("can: {}: no default, because a limit is missing or infinite; add the key", key);
  const Eigen::VectorXd scaled = kRangePerLimit * limits;
  return {scaled.begin(), scaled.end()};
}

}  // namespace

void describe_can(ConfigVisitor& v, CanFile& f) {
  CanSpec& spec = f.config.spec;
  f.config.present = true;
  choose(v, "mode", f.config.mode, kOptional,
         "streaming: sample by sample; resident: the node runs the experiment in its own loop");
  items(v, "buses", describe_bus, f.buses, {1, 16}, kRequired,
        "CAN FD buses; the first one also carries commands and transfers");
  v.numbers(
      "actuator_range_n", f.actuator_range_n, positive("N"), {}, kOptional,
      "full scale of 2^23 counts; one for all or one per actuator; omitted: 1.25 times limit_n");
  v.numbers("actuator_range", f.actuator_range_n, positive(""), {}, kOptional,
            "the same in the units of the actuators");
  v.numbers(
      "sensor_range_m", f.sensor_range_m, positive("m"), {}, kOptional,
      "full scale of 2^23 counts; one for all or one per sensor; omitted: 1.25 times window_m");
  v.numbers("sensor_range", f.sensor_range_m, positive(""), {}, kOptional,
            "the same in the units of the sensors");
  std::size_t clock = spec.node_clock ? 1 : 0;
  v.choice("clock", clock, {"host", "node"}, kOptional,
           "clock of the samples. node: the node samples at its own ticks, and the host follows it "
           "with pace: 1");
  spec.node_clock = clock == 1;
  v.number("reply_timeout_s", spec.reply_timeout_s, positive("s"), kOptional,
           "the host waits this long for a reply");
  v.number("watchdog_s", f.watchdog_s, not_negative("s"), kOptional,
           "the node stops if it receives no setpoint for this long. 0: one period more than it "
           "takes to replace a lost frame, at least 20 ms");
  v.number("largest_load", spec.largest_load, {"", 0.0, 1.0, true}, kOptional,
           "largest load of a bus; experiments that need more are refused");
}

CanConfig complete_can(const CanFile& file, const StageInfo& info, const StageLimits& limits) {
  CanConfig config = file.config;
  CanSpec& spec = config.spec;
  if (spec.node_clock && info.clock != Clock::wall)
    fail_request("can: clock: node needs the wall clock; set pace: 1, or clock: host");
  const double pause_s = can_longest_pause_s(spec, info);
  if (file.watchdog_s > 0.0 && file.watchdog_s < pause_s && config.mode == CanMode::streaming)
    fail_request(
        "can: watchdog_s: {:.4g} s is too short: the node would stop the stage before a lost frame "
        "is replaced. Use more than {:.4g} s{}",
        file.watchdog_s, pause_s,
        info.clock == Clock::wall ? "" : ", or a shorter reply_timeout_s");
  spec.watchdog_s = file.watchdog_s > 0.0
                        ? file.watchdog_s
                        : std::max(kLeastWatchdog_s, pause_s + 1.0 / info.sample_rate_hz);
  const bool only = file.buses.size() == 1;
  for (const CanFile::Bus& bus : file.buses)
    if (is_zeromq(bus.spec.interface) && (config.mode != CanMode::resident || !only))
      fail_request(
          "can: bus {}: ZeroMQ carries resident experiments over a single bus; set mode: resident",
          bus.spec.interface);
  for (const CanFile::Bus& bus : file.buses) {
    CanBusSpec complete = bus.spec;
    complete.actuators = channel_numbers(bus.actuators, info.actuators, only, bus.spec.interface);
    complete.sensors = channel_numbers(bus.sensors, info.sensors, only, bus.spec.interface);
    spec.buses.push_back(std::move(complete));
  }
  spec.actuator_range_n =
      ranges(file.actuator_range_n, limits.actuator_n, info.actuators.size(), "actuator_range_n");
  spec.sensor_range_m =
      ranges(file.sensor_range_m, limits.position_window_m, info.sensors.size(), "sensor_range_m");
  static_cast<void>(can_layout(spec, info));
  return config;
}

}  // namespace stageid
