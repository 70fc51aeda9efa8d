#include "hal/modbus/modbus_map.hpp"

#include <fmt/format.h>

#include <iterator>

#include "hal/stage/require.hpp"

namespace stageid::modbus_map {
namespace {

constexpr Entry kEntries[] = {
    {kHeartbeat, "heartbeat", "incremented by the supervising host with every poll", Access::write},
    {kCommand, "command", "1 enable, 2 disable, 3 quick stop, 4 reset fault", Access::write},
    {kCommandSequence, "command_sequence", "a new value gives the command", Access::write},
    {kRunCommand, "run_command", "1 begin a run, 2 end it", Access::write},
    {kRunSequence, "run_sequence",
     "a new value gives the run command; random, chosen by the host, not 0", Access::write},
    {kRunSeed, "run_seed", "of the run; simulated stages repeat a run with the same seed",
     Access::write, Type::u64},
    {kRunKey, "run_key",
     "the session key, to end the run and with every setpoint; 0 to begin a run", Access::write},
    {kSetpointSequence, "setpoint_sequence",
     "1, 2, ... in a run; a newer value moves the stage by one sample", Access::write},
    {kSetpoint, "setpoint", "u[n], one per actuator", Access::write, Type::i32, kMostChannels,
     "actuator_scale"},
    {kMagic, "magic", "0x53544749, \"STGI\""},
    {kVersion, "map_version", "2"},
    {kBootId, "boot_id", "changes with every start of the node"},
    {kHeartbeatEcho, "heartbeat_echo", "the heartbeat that the node's program has read"},
    {kState, "state",
     "0 not ready, 1 switch on disabled, 2 ready, 3 switched on, 4 operation enabled, 5 measuring, "
     "6 quick stop, 7 fault reaction, 8 fault"},
    {kCause, "cause",
     "of the fault: 0 none, 1 host silent, 2 limit, 3 value not finite, 4 interlock, 5 stage, 6 "
     "gravity compensator, 7 temperature, 8 bus off, 9 heartbeat"},
    {kFlags, "flags", "bit 0 interlock closed, bit 1 enabled"},
    {kCommandEcho, "command_echo", "sequence of the last command given"},
    {kCommandReply, "command_reply", "0 none yet, 1 accepted, 2 refused"},
    {kGravityCount, "gravity_compensators", "number"},
    {kTemperatureCount, "temperatures", "number"},
    {kGravity, "gravity_compensator", "force of each", Access::read, Type::f32, kMostPanelValues,
     "N"},
    {kTemperature, "temperature", "of each", Access::read, Type::f32, kMostPanelValues, "K"},
    {kMeasurementBootId, "measurement_boot_id", "as boot_id"},
    {kMeasurementSequence, "measurement_sequence",
     "of the setpoint that was answered; 0: y[0] of the run"},
    {kSession, "session", "key of the run, for the connection that began it; 0 for all others"},
    {kMeasurementStatus, "measurement_status",
     "bits 0-7 outcome, 8-15 state, 16-23 cause, 24-31 setpoints missed (saturated)"},
    {kValid, "valid", "bit i: sensor i is valid", Access::read, Type::u64},
    {kMeasurement, "measurement", "y[n+1], one per sensor", Access::read, Type::i32, kMostChannels,
     "sensor_scale"},
    {kActuatorCount, "actuators", "number"},
    {kSensorCount, "sensors", "number"},
    {kSampleRate, "sample_rate", "of the loop", Access::read, Type::f32, 1, "Hz"},
    {kChannelHash, "channel_hash", "FNV-1a of \"NAME UNIT\\n\" of all actuators, then sensors"},
    {kActuatorScale, "actuator_scale", "of one count, a power of two", Access::read, Type::f32,
     kMostChannels, "N"},
    {kSensorScale, "sensor_scale", "of one count, a power of two", Access::read, Type::f32,
     kMostChannels, "m"},
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
