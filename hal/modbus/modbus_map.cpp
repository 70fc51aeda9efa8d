#include "hal/modbus/modbus_map.hpp"

#include <fmt/format.h>

#include <array>
#include <iterator>

#include "hal/stage/require.hpp"

namespace stageid::modbus_map {
namespace {

constexpr Entry kEntries[] = {
    {kHeartbeat, "heartbeat", Type::u32, 1, "1", Access::write,
     "incremented by the supervising host with every poll"},
    {kCommand, "command", Type::u32, 1, "1", Access::write,
     "1 enable, 2 disable, 3 quick stop, 4 reset fault"},
    {kCommandSequence, "command_sequence", Type::u32, 1, "1", Access::write,
     "a new value gives the command"},
    {kRunCommand, "run_command", Type::u32, 1, "1", Access::write, "1 begin a run, 2 end it"},
    {kRunSequence, "run_sequence", Type::u32, 1, "1", Access::write,
     "a new value gives the run command; random, chosen by the host, not 0"},
    {kRunSeed, "run_seed", Type::u64, 1, "1", Access::write,
     "of the run; simulated stages repeat a run with the same seed"},
    {kRunKey, "run_key", Type::u32, 1, "1", Access::write,
     "the session key, to end the run and with every setpoint; 0 to begin a run"},
    {kSetpointSequence, "setpoint_sequence", Type::u32, 1, "1", Access::write,
     "1, 2, ... in a run; a newer value moves the stage by one sample"},
    {kSetpoint, "setpoint", Type::i32, kMostChannels, "actuator_scale", Access::write,
     "u[n], one per actuator"},
    {kMagic, "magic", Type::u32, 1, "1", Access::read, "0x53544749, \"STGI\""},
    {kVersion, "map_version", Type::u32, 1, "1", Access::read, "2"},
    {kBootId, "boot_id", Type::u32, 1, "1", Access::read, "changes with every start of the node"},
    {kHeartbeatEcho, "heartbeat_echo", Type::u32, 1, "1", Access::read,
     "the heartbeat that the node's program has read"},
    {kState, "state", Type::u32, 1, "1", Access::read,
     "0 not ready, 1 switch on disabled, 2 ready, 3 switched on, 4 operation enabled, 5 measuring, "
     "6 quick stop, 7 fault reaction, 8 fault"},
    {kCause, "cause", Type::u32, 1, "1", Access::read,
     "of the fault: 0 none, 1 host silent, 2 limit, 3 value not finite, 4 interlock, 5 stage, 6 "
     "gravity compensator, 7 temperature, 8 bus off, 9 heartbeat"},
    {kFlags, "flags", Type::u32, 1, "1", Access::read, "bit 0 interlock closed, bit 1 enabled"},
    {kCommandEcho, "command_echo", Type::u32, 1, "1", Access::read,
     "sequence of the last command given"},
    {kCommandReply, "command_reply", Type::u32, 1, "1", Access::read,
     "0 none yet, 1 accepted, 2 refused"},
    {kGravityCount, "gravity_compensators", Type::u32, 1, "1", Access::read, "number"},
    {kTemperatureCount, "temperatures", Type::u32, 1, "1", Access::read, "number"},
    {kGravity, "gravity_compensator", Type::f32, kMostPanelValues, "N", Access::read,
     "force of each"},
    {kTemperature, "temperature", Type::f32, kMostPanelValues, "K", Access::read, "of each"},
    {kMeasurementBootId, "measurement_boot_id", Type::u32, 1, "1", Access::read, "as boot_id"},
    {kMeasurementSequence, "measurement_sequence", Type::u32, 1, "1", Access::read,
     "of the setpoint that was answered; 0: y[0] of the run"},
    {kSession, "session", Type::u32, 1, "1", Access::read,
     "key of the run, for the connection that began it; 0 for all others"},
    {kMeasurementStatus, "measurement_status", Type::u32, 1, "1", Access::read,
     "bits 0-7 outcome, 8-15 state, 16-23 cause, 24-31 setpoints missed (saturated)"},
    {kValid, "valid", Type::u64, 1, "1", Access::read, "bit i: sensor i is valid"},
    {kMeasurement, "measurement", Type::i32, kMostChannels, "sensor_scale", Access::read,
     "y[n+1], one per sensor"},
    {kActuatorCount, "actuators", Type::u32, 1, "1", Access::read, "number"},
    {kSensorCount, "sensors", Type::u32, 1, "1", Access::read, "number"},
    {kSampleRate, "sample_rate", Type::f32, 1, "Hz", Access::read, "of the loop"},
    {kChannelHash, "channel_hash", Type::u32, 1, "1", Access::read,
     "FNV-1a of \"NAME UNIT\\n\" of all actuators, then sensors"},
    {kActuatorScale, "actuator_scale", Type::f32, kMostChannels, "N", Access::read,
     "of one count, a power of two"},
    {kSensorScale, "sensor_scale", Type::f32, kMostChannels, "m", Access::read,
     "of one count, a power of two"},
};

}  // namespace

std::span<const Entry> entries() noexcept { return kEntries; }

std::string markdown_table() {
  std::string table =
      "| address | registers | name | type | unit of 1 | access | meaning |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n";
  for (const Entry& e : kEntries) {
    const std::string name =
        e.count > 1 ? fmt::format("{}[{}]", e.name, e.count) : std::string(e.name);
    fmt::format_to(std::back_inserter(table), "| {} | {} | {} | {} | {} | {} | {} |\n", e.address,
                   e.registers(), name, to_string(e.type), e.unit,
                   e.access == Access::read ? "read" : "read, write", e.meaning);
  }
  return table;
}

void require_channels(const StageInfo& info) {
  require(info.actuators.size() <= kMostChannels && info.sensors.size() <= kMostChannels,
          "modbus: {} actuators and {} sensors; one transaction carries at most {} of each",
          info.actuators.size(), info.sensors.size(), kMostChannels);
}

std::uint32_t channel_hash(const StageInfo& info) {
  std::uint32_t hash = 0x811C9DC5U;
  for (const auto* channels : {&info.actuators, &info.sensors})
    for (const Channel& channel : *channels)
      for (const char c : fmt::format("{} {}\n", channel.name, channel.unit))
        hash = (hash ^ static_cast<unsigned char>(c)) * 0x01000193U;
  return hash;
}

}  // namespace stageid::modbus_map
