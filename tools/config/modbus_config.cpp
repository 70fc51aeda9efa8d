#include "tools/config/modbus_config.hpp"

#include <vector>

namespace stageid {
namespace {

constexpr double kStalePolls = 3.0;

void describe_tcp(ConfigVisitor& v, ModbusAddress& a) {
  v.text("host", a.host, kOptional, "IPv4 address");
  count(v, "port", a.port, 1, 65535, kOptional, "TCP port; the standard port of Modbus is 502");
}

void describe_rtu(ConfigVisitor& v, ModbusAddress& a) {
  v.text("device", a.device, kRequired, "serial line, /dev/tty...");
  count(v, "baud", a.baud, 1200, 4000000, kOptional, "bits per second");
  const std::vector<std::string> parities = {"N", "E", "O"};
  std::size_t parity = 1;
  v.choice("parity", parity, parities, kOptional, "8 data bits; without parity 2 stop bits");
  a.parity = parities[parity].front();
}

/// [low, high]
void describe_range(ConfigVisitor& v, const char* key, double& low, double& high,
                    std::string_view unit, const char* help) {
  std::vector<double> range = {low, high};
  v.numbers(key, range, any_number(unit), {2, 2}, kRequired, help);
  if (range.size() != 2) return;
  v.require(range[0] <= range[1], key, std::string(key) + ": write [low, high] with low <= high");
  low = range[0];
  high = range[1];
}

void describe_modbus(ConfigVisitor& v, ModbusConfig& c) {
  bool tcp = false;
  bool rtu = false;
  v.group(
      "tcp",
      [&](ConfigVisitor& keys) {
        tcp = true;
        describe_tcp(keys, c.address);
      },
      kOptional, "Modbus TCP; this or rtu");
  v.group(
      "rtu",
      [&](ConfigVisitor& keys) {
        rtu = true;
        describe_rtu(keys, c.address);
      },
      kOptional, "Modbus RTU; this or tcp");
  v.require(tcp != rtu, tcp ? "tcp" : "unit", "modbus: write exactly one of tcp and rtu");
  count(v, "unit", c.address.unit, 1, 247, kOptional, "unit of the server");
  v.number("response_s", c.timing.response_s, {"s", 0.001, 60.0}, kOptional,
           "a reply later than this counts as missing");
  v.number("worst_reply_s", c.timing.worst_reply_s, {"s", 0.001, 3600.0}, kOptional,
           "after this time a reply is no longer expected");
  v.number("device_s", c.timing.device_s, {"s", 1e-5, 60.0}, kOptional,
           "time the server needs for a reply; limits the sample rate");
  v.require(c.timing.worst_reply_s >= c.timing.response_s, "worst_reply_s",
            "worst_reply_s: less than response_s; write at least response_s");
}

void describe_supervisor(ConfigVisitor& v, SupervisorConfig& c) {
  group(v, "modbus", describe_modbus, c.link, kRequired, "address of the supervisor");
  v.number("poll_period_s", c.options.poll_period_s, {"s", 0.001, 60.0}, kOptional,
           "period of the status requests; the run ends after three without a good status");
  describe_range(v, "gravity_compensator_n", c.conditions.gravity_low_n,
                 c.conditions.gravity_high_n, "N", "[low, high] of every gravity compensator");
  describe_range(v, "temperature_k", c.conditions.temperature_low_k,
                 c.conditions.temperature_high_k, "K", "[low, high] of every temperature");
  v.number("enable_s", c.conditions.enable_s, positive("s"), kOptional,
           "time allowed for the plant to answer and to start up");
  c.conditions.stale_s = kStalePolls * c.options.poll_period_s;
}

}  // namespace

void describe_modbus_groups(ConfigVisitor& v, bool behind_modbus,
                            std::optional<ModbusConfig>& stage,
                            std::optional<SupervisorConfig>& supervisor) {
  v.group(
      "modbus", [&](ConfigVisitor& keys) { describe_modbus(keys, stage.emplace()); }, kOptional,
      "backend modbus: address of the stage");
  v.require(!behind_modbus || stage.has_value(), "backend",
            "backend: modbus needs the group 'modbus'; add it with the address of the stage");
  v.group(
      "supervisor", [&](ConfigVisitor& keys) { describe_supervisor(keys, supervisor.emplace()); },
      kOptional, "enable chain, gravity compensators, temperatures and interlocks, over Modbus");
  const bool one_line = stage && supervisor && stage->address.serial() &&
                        stage->address.device == supervisor->link.address.device;
  v.require(!one_line, "supervisor",
            "supervisor: the stage uses the same serial line, which supports one link only; use "
            "another line, or tcp");
}

}  // namespace stageid
