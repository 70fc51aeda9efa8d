#include "hal/modbus/modbus_supervisor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/modbus/modbus_map.hpp"
#include "hal/modbus/modbus_session.hpp"
#include "hal/stage/pacer.hpp"

namespace stageid {

namespace map = modbus_map;

namespace {

using Seconds = std::chrono::duration<double>;
using Status = RegisterBlock<const std::uint16_t>;

std::vector<double> numbers(Status status, int count_address, int address) {
  const auto most = static_cast<std::uint32_t>(map::kMostPanelValues);
  const std::uint32_t count = std::min(most, status.u32(count_address));
  std::vector<double> values;
  for (int i = 0; i < static_cast<int>(count); ++i) values.push_back(status.f32(address + 2 * i));
  return values;
}

PlantSnapshot parse(Status status) {
  PlantSnapshot snapshot;
  const std::uint32_t flags = status.u32(map::kFlags);
  snapshot.t_ns = monotonic_ns();
  snapshot.heartbeat = status.u32(map::kHeartbeatEcho);
  snapshot.interlock_closed = (flags & map::kFlagInterlockClosed) != 0;
  snapshot.enabled = (flags & map::kFlagEnabled) != 0;
  snapshot.state = static_cast<NodeState>(status.u32(map::kState) & 0xFFU);
  snapshot.cause = static_cast<FaultCause>(status.u32(map::kCause) & 0xFFU);
  snapshot.gravity_compensator_n = numbers(status, map::kGravityCount, map::kGravity);
  snapshot.temperature_k = numbers(status, map::kTemperatureCount, map::kTemperature);
  return snapshot;
}

void check(const ModbusSupervisorOptions& o) {
  require(o.poll_period_s >= 0.001 && o.poll_period_s <= 60.0 && o.backoff_first_s > 0.0 &&
              o.backoff_first_s <= o.backoff_longest_s && o.backoff_longest_s <= 3600.0,
          "supervisor: invalid poll period {} s (0.001 to 60) or back-off {} to {} s",
          o.poll_period_s, o.backoff_first_s, o.backoff_longest_s);
}

}  // namespace

ModbusSupervisor::ModbusSupervisor(const ModbusAddress& address, const ModbusTiming& timing,
                                   const ModbusSupervisorOptions& options)
    : link_(address, timing), options_(options), trouble_("not connected yet") {
  check(options);
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

PlantSnapshot ModbusSupervisor::snapshot() const {
  const std::lock_guard lock(mutex_);
  return snapshot_;
}

std::string ModbusSupervisor::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

void ModbusSupervisor::set_trouble(std::string trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = std::move(trouble);
}

SupervisorReply ModbusSupervisor::request(SupervisorCommand command) {
  const std::lock_guard one(request_mutex_);
  std::unique_lock lock(mutex_);
  wanted_ = command;
  sent_ = false;
  reply_.reset();
  changed_.notify_all();
  // The current poll, its repetition, and the poll with the command.
  const Seconds allowance(3.0 * (options_.poll_period_s + link_.timing().worst_reply_s));
  const bool answered = changed_.wait_for(lock, allowance, [this] { return reply_.has_value(); });
  wanted_.reset();
  if (answered) return *std::exchange(reply_, std::nullopt);
  return {false, trouble_.empty() ? "the command was not answered" : trouble_};
}

void ModbusSupervisor::run(const std::stop_token& stop) {
  double backoff_s = options_.backoff_first_s;
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    lock.unlock();
    const bool good = connect() && poll();
    lock.lock();
    // A new command interrupts the wait for the next poll, unless the link is down.
    const double pause_s = good ? options_.poll_period_s : backoff_s;
    backoff_s =
        good ? options_.backoff_first_s : std::min(2.0 * backoff_s, options_.backoff_longest_s);
    changed_.wait_for(lock, stop, Seconds(pause_s), [&] { return good && wanted_ && !sent_; });
  }
}

/// Connects if necessary and continues the command numbers of the previous host.
bool ModbusSupervisor::connect() {
  if (link_.connected()) return true;
  if (!link_.try_connect()) {
    set_trouble(link_.describe(link_.last()));
    return false;
  }
  std::array<std::uint16_t, map::kStatusRegisters> registers{};
  const Status status(map::kMagic, registers);
  if (link_.read(map::kMagic, registers) != LinkStatus::ok) {
    set_trouble(link_.describe(link_.last()));
  } else if (std::string wrong = map_trouble(status); !wrong.empty()) {
    set_trouble(fmt::format("{}: {}", to_string(link_.address()), wrong));
  } else {
    command_sequence_ = status.u32(map::kCommandEcho);
    // Far enough ahead that the first poll is valid only if the echo changes.
    heartbeat_ = status.u32(map::kHeartbeatEcho) + kEchoPolls;
    return true;
  }
  link_.drain();
  link_.close();
  return false;
}

bool ModbusSupervisor::poll() {
  {
    const std::lock_guard lock(mutex_);
    if (wanted_ && !sent_) {
      command_ = static_cast<std::uint32_t>(*wanted_) + 1;
      ++command_sequence_;
      sent_ = true;
    }
  }
  ++heartbeat_;
  std::array<std::uint16_t, map::kStatusRegisters> status{};
  if (link_.repeat_once([&] { return transact(status); }) == LinkStatus::ok)
    return take_status({map::kMagic, status});
  set_trouble(link_.describe(link_.last()));
  link_.drain();
  link_.close();
  const std::lock_guard lock(mutex_);
  sent_ = false;  // its arrival is unknown; it gets a new number after reconnecting
  return false;
}

LinkStatus ModbusSupervisor::transact(std::span<std::uint16_t> status) {
  std::array<std::uint16_t, map::kSupervisorRegisters> request{};
  const RegisterBlock out(map::kHeartbeat, request);
  out.set_u32(map::kHeartbeat, heartbeat_);
  out.set_u32(map::kCommand, command_);
  out.set_u32(map::kCommandSequence, command_sequence_);
  return link_.exchange(map::kHeartbeat, request, map::kMagic, status);
}

bool ModbusSupervisor::take_status(RegisterBlock<const std::uint16_t> status) {
  std::string wrong = map_trouble(status);
  const std::uint32_t age = heartbeat_ - status.u32(map::kHeartbeatEcho);
  if (wrong.empty() && age > kEchoPolls)
    wrong = fmt::format("the heartbeat stopped at {}: the program behind the server hangs",
                        status.u32(map::kHeartbeatEcho));
  const std::lock_guard lock(mutex_);
  if (!wrong.empty()) {
    trouble_ = fmt::format("{}: {}", to_string(link_.address()), wrong);
    return true;  // the link itself is good: keep polling
  }
  trouble_.clear();
  snapshot_ = parse(status);
  if (wanted_ && sent_ && status.u32(map::kCommandEcho) == command_sequence_) {
    const bool accepted = status.u32(map::kCommandReply) == map::kReplyAccepted;
    std::string why;
    if (!accepted)
      why = fmt::format("refused in state {}{}", to_string(snapshot_.state),
                        snapshot_.cause == FaultCause::none
                            ? ""
                            : fmt::format(" ({})", to_string(snapshot_.cause)));
    reply_ = SupervisorReply{accepted, std::move(why)};
    wanted_.reset();
    changed_.notify_all();
  }
  return true;
}

}  // namespace stageid
