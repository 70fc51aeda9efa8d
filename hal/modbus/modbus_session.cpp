#include "hal/modbus/modbus_session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <span>

#include "hal/modbus/modbus_map.hpp"
#include "hal/stage/peer_status.hpp"

namespace stageid {

namespace map = modbus_map;

namespace {

/// Registers with their addresses.
class Block {
 public:
  Block(ModbusClient& link, int first, std::size_t count)
      : first_(first), registers_(read_registers(link, first, count)) {}
  RegisterBlock<const std::uint16_t> numbers() const { return {first_, registers_}; }
  std::uint32_t operator[](int address) const { return numbers().u32(address); }
  std::vector<double> scales(int address, std::size_t count) const {
    std::vector<double> values;
    for (std::size_t i = 0; i < count; ++i)
      values.push_back(numbers().f32(address + 2 * static_cast<int>(i)));
    return values;
  }

 private:
  int first_;
  std::vector<std::uint16_t> registers_;
};

[[noreturn]] void refuse(ModbusClient& link, const std::string& what) {
  link.close();
  throw StageError(fmt::format("{}: {}", to_string(link.address()), what));
}

[[noreturn]] void refuse(ModbusClient& link, PeerStatus status, const std::string& detail) {
  refuse(link, meaning(status).words + detail);
}

bool sound(const std::vector<double>& scales) {
  return std::all_of(scales.begin(), scales.end(),
                     [](double scale) { return scale > 0.0 && std::isfinite(scale); });
}

template <std::size_t Count, typename Answered>
void transact(ModbusClient& link, int first, const std::array<std::uint16_t, Count>& request,
              int read_first, std::span<std::uint16_t> reply, Answered answered) {
  bool foreign = false;
  const LinkStatus done = link.repeat_once([&] {
    const LinkStatus once = link.exchange(first, request, read_first, reply);
    foreign = once == LinkStatus::ok && !answered();
    return foreign ? LinkStatus::corrupt : once;
  });
  if (done == LinkStatus::ok) return;
  throw StageError(foreign ? fmt::format("{}: {}", to_string(link.address()), kForeignReplies)
                           : link.describe(link.last()));
}

std::string describe(const ModbusState& state) {
  return fmt::format("state {}, cause: {}{}; remove the cause{}", to_string(state.state),
                     to_string(state.cause),
                     state.interlock_closed ? "" : ", the interlock is open",
                     state.state == NodeState::fault ? " and add --reset-fault" : "");
}

/// Sends a run command. `session`: the expected key in the answer, 0: any but 0.
/// @return the key in the answer.
std::uint32_t give_run_command(ModbusClient& link, std::uint32_t command, std::uint64_t run_seed,
                               std::uint32_t session, std::vector<std::uint16_t>& reply) {
  std::random_device random;
  std::array<std::uint16_t, map::kRunRegisters> request{};
  const RegisterBlock out(map::kRunCommand, request);
  out.set_u32(map::kRunCommand, command);
  out.set_u32(map::kRunSequence, random() | 1U);
  out.set_u64(map::kRunSeed, run_seed);
  out.set_u32(map::kRunKey, session);
  const auto shown = [&] {
    return RegisterBlock(map::kMeasurementBootId, reply).u32(map::kSession);
  };
  transact(link, map::kRunCommand, request, map::kMeasurementBootId, reply,
           [&] { return shown() != 0 && (session == 0 || shown() == session); });
  return shown();
}

}  // namespace

std::vector<std::uint16_t> read_registers(ModbusClient& link, int first, std::size_t count) {
  constexpr std::size_t kMost = 120;
  std::vector<std::uint16_t> registers(count);
  for (std::size_t at = 0; at < count; at += kMost) {
    const auto part = std::span(registers).subspan(at, std::min(kMost, count - at));
    const auto once = [&] { return link.read(first + static_cast<int>(at), part); };
    if (link.repeat_once(once) == LinkStatus::ok) continue;
    const std::string trouble = link.describe(link.last());
    link.close();
    throw StageError(trouble);
  }
  return registers;
}

std::string map_trouble(RegisterBlock<const std::uint16_t> status) {
  if (status.u32(map::kMagic) != map::kMagicValue)
    return fmt::format(
        "register {} does not contain {:#010x}, so this is not a stage; check the unit",
        map::kMagic, map::kMagicValue);
  if (status.u32(map::kVersion) != map::kVersionValue)
    return fmt::format("{} (register map {}; expected {}); update the older program",
                       meaning(PeerStatus::other_version).words, status.u32(map::kVersion),
                       map::kVersionValue);
  return "";
}

ModbusDescription read_description(ModbusClient& link, const StageInfo& expected) {
  const Block status(link, map::kMagic, 6);
  if (const std::string wrong = map_trouble(status.numbers()); !wrong.empty()) refuse(link, wrong);
  const Block block(link, map::kActuatorCount,
                    static_cast<std::size_t>(map::kEnd - map::kActuatorCount));
  if (block[map::kActuatorCount] != expected.actuators.size() ||
      block[map::kSensorCount] != expected.sensors.size() ||
      block[map::kChannelHash] != map::channel_hash(expected))
    refuse(link, PeerStatus::other_stage,
           fmt::format(": the node has {} actuators and {} sensors, the host {} and {}, or the "
                       "names differ; use the same stage file on both sides",
                       block[map::kActuatorCount], block[map::kSensorCount],
                       expected.actuators.size(), expected.sensors.size()));
  const double rate_hz = block.numbers().f32(map::kSampleRate);
  if (!(std::abs(rate_hz - expected.sample_rate_hz) <= 1e-6 * expected.sample_rate_hz))
    refuse(link, PeerStatus::other_stage,
           fmt::format(": the node runs at {} Hz, the stage file has {} Hz; use the same stage "
                       "file on both sides",
                       rate_hz, expected.sample_rate_hz));
  ModbusDescription description;
  description.boot_id = status[map::kBootId];
  description.actuator_scale = block.scales(map::kActuatorScale, expected.actuators.size());
  description.sensor_scale = block.scales(map::kSensorScale, expected.sensors.size());
  if (!sound(description.actuator_scale) || !sound(description.sensor_scale))
    refuse(link, "the scale of a channel is not positive; correct it in the node");
  return description;
}

ModbusState read_state(ModbusClient& link) {
  const Block block(link, map::kState, 6);
  return {static_cast<NodeState>(block[map::kState] & 0xFFU),
          static_cast<FaultCause>(block[map::kCause] & 0xFFU),
          (block[map::kFlags] & map::kFlagInterlockClosed) != 0,
          (block[map::kFlags] & map::kFlagEnabled) != 0};
}

void give_supervisor_command(ModbusClient& link, SupervisorCommand command) {
  const std::uint32_t sequence = Block(link, map::kCommandEcho, 2)[map::kCommandEcho] + 1;
  std::array<std::uint16_t, 4> request{};
  const RegisterBlock out(map::kCommand, request);
  out.set_u32(map::kCommand, static_cast<std::uint32_t>(command) + 1);
  out.set_u32(map::kCommandSequence, sequence);
  std::array<std::uint16_t, 4> reply{};
  const RegisterBlock replied(map::kCommandEcho, reply);
  transact(link, map::kCommand, request, map::kCommandEcho, reply,
           [&] { return replied.u32(map::kCommandEcho) == sequence; });
  if (replied.u32(map::kCommandReply) == map::kReplyAccepted) return;
  throw StageError(fmt::format("{}: the command was refused: {}", to_string(link.address()),
                               describe(read_state(link))));
}

std::uint32_t begin_run(ModbusClient& link, std::uint64_t run_seed,
                        std::vector<std::uint16_t>& reply) {
  try {
    return give_run_command(link, map::kRunBegin, run_seed, 0, reply);
  } catch (const StageError&) {
    if (link.last().status != LinkStatus::refused) throw;
  }
  const std::string place = to_string(link.address());
  if (link.refused_as_busy()) refuse(PeerStatus::held, place, "; wait until it has ended");
  throw StageError(
      fmt::format("{}: the node does not start a run: {}", place, describe(read_state(link))));
}

void end_run(ModbusClient& link, std::uint32_t session, std::vector<std::uint16_t>& reply) {
  static_cast<void>(give_run_command(link, map::kRunEnd, 0, session, reply));
}

}  // namespace stageid
