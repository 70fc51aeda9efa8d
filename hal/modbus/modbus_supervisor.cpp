#include "hal/modbus/modbus_supervisor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <stdexcept>
#include <utility>

#include "hal/modbus/modbus_encoding.hpp"
#include "hal/modbus/modbus_map.hpp"
#include "hal/stage/pacer.hpp"
#include "hal/stage/peer_status.hpp"

namespace stageid {

namespace map = modbus_map;

namespace {

using Seconds = std::chrono::duration<double>;
using Status = std::span<const std::uint16_t>;

std::span<const std::uint16_t, 2> pair_at(Status status, int address) {
  return status.subspan(static_cast<std::size_t>(address - map::kMagic)).first<2>();
}

std::uint32_t u32(Status status, int address) { return get_u32(pair_at(status, address)); }

std::vector<double> numbers(Status status, int count_address, int address) {
  const auto most = static_cast<std::uint32_t>(map::kMostPanelValues);
  const std::uint32_t count = std::min(most, u32(status, count_address));
  std::vector<double> values;
  for (int i = 0; i < static_cast<int>(count); ++i)
    values.push_back(static_cast<double>(get_f32(pair_at(status, address + 2 * i))));
  return values;
}

PlantSnapshot parse(Status status) {
  PlantSnapshot snapshot;
  const std::uint32_t flags = u32(status, map::kFlags);
  snapshot.t_ns = monotonic_ns();
  snapshot.heartbeat = u32(status, map::kHeartbeatEcho);
  snapshot.interlock_closed = (flags & map::kFlagInterlockClosed) != 0;
  snapshot.enabled = (flags & map::kFlagEnabled) != 0;
  snapshot.state = static_cast<NodeState>(u32(status, map::kState) & 0xFFU);
  snapshot.cause = static_cast<FaultCause>(u32(status, map::kCause) & 0xFFU);
  snapshot.gravity_compensator_n = numbers(status, map::kGravityCount, map::kGravity);
  snapshot.temperature_k = numbers(status, map::kTemperatureCount, map::kTemperature);
  return snapshot;
}

/// Describes a mismatch of the register map; empty: none.
std::string map_trouble(Status status) {
  if (u32(status, map::kMagic) != map::kMagicValue)
    return fmt::format("register {} contains {:#010x}; expected {:#010x}. Check the unit",
                       map::kMagic, u32(status, map::kMagic), map::kMagicValue);
  if (u32(status, map::kVersion) != map::kVersionValue)
    return fmt::format("{} (register map {}; expected {}); update the older program",
                       meaning(PeerStatus::other_version).words, u32(status, map::kVersion),
                       map::kVersionValue);
  return "";
}

void check(const ModbusSupervisorOptions& o) {
  const bool sound = o.poll_period_s >= 0.001 && o.poll_period_s <= 60.0 &&
                     o.backoff_first_s > 0.0 && o.backoff_first_s <= o.backoff_longest_s &&
                     o.backoff_longest_s <= 3600.0;
  if (!sound)
    throw std::invalid_argument(
        fmt::format("supervisor: invalid poll period {} s (0.001 to 60) or back-off {} to {} s",
                    o.poll_period_s, o.backoff_first_s, o.backoff_longest_s));
}

}  // namespace

ModbusSupervisor::ModbusSupervisor(const ModbusAddress& address, const ModbusTiming& timing,
                                   const ModbusSupervisorOptions& options)
    : link_(address, timing), options_(options), trouble_("not connected yet") {
  check(options);
  thread_ = std::thread([this] { run(); });
}

ModbusSupervisor::~ModbusSupervisor() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
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

double ModbusSupervisor::reply_allowance_s() const noexcept {
  // The current poll, its repetition, and the poll with the command.
  return 3.0 * (options_.poll_period_s + link_.timing().worst_reply_s);
}

SupervisorReply ModbusSupervisor::request(SupervisorCommand command) {
  const std::lock_guard one(request_mutex_);
  std::unique_lock lock(mutex_);
  wanted_ = command;
  sent_ = false;
  reply_.reset();
  changed_.notify_all();
  const bool answered =
      changed_.wait_for(lock, Seconds(reply_allowance_s()), [this] { return reply_.has_value(); });
  wanted_.reset();
  if (answered) return *std::exchange(reply_, std::nullopt);
  return {false, trouble_.empty() ? "the command was not answered" : trouble_};
}

void ModbusSupervisor::run() {
  double backoff_s = options_.backoff_first_s;
  std::unique_lock lock(mutex_);
  while (!stop_) {
    lock.unlock();
    const bool good = connect() && poll();
    lock.lock();
    // A new command interrupts the wait for the next poll, unless the link is down.
    const double pause_s = good ? options_.poll_period_s : backoff_s;
    backoff_s =
        good ? options_.backoff_first_s : std::min(2.0 * backoff_s, options_.backoff_longest_s);
    changed_.wait_for(lock, Seconds(pause_s), [&] { return stop_ || (good && wanted_ && !sent_); });
  }
}

/// Connects if necessary and continues the command numbers of the previous host.
bool ModbusSupervisor::connect() {
  if (link_.connected()) return true;
  if (!link_.try_connect()) {
    set_trouble(link_.describe(link_.last()));
    return false;
  }
  std::array<std::uint16_t, map::kStatusRegisters> status{};
  if (link_.read(map::kMagic, status) != LinkStatus::ok) {
    set_trouble(link_.describe(link_.last()));
  } else if (std::string wrong = map_trouble(status); !wrong.empty()) {
    set_trouble(fmt::format("{}: {}", to_string(link_.address()), wrong));
  } else {
    command_sequence_ = u32(status, map::kCommandEcho);
    // Far enough ahead that the first poll is valid only if the echo changes.
    heartbeat_ = u32(status, map::kHeartbeatEcho) + kEchoPolls;
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
  LinkStatus done = transact(status);
  if (done != LinkStatus::ok) {
    link_.drain();
    done = transact(status);
  }
  if (done == LinkStatus::ok) return take_status(status);
  set_trouble(link_.describe(link_.last()));
  link_.drain();
  link_.close();
  const std::lock_guard lock(mutex_);
  sent_ = false;  // its arrival is unknown; it gets a new number after reconnecting
  return false;
}

LinkStatus ModbusSupervisor::transact(std::span<std::uint16_t> status) {
  std::array<std::uint16_t, map::kSupervisorRegisters> request{};
  const std::span<std::uint16_t> out = request;
  put_u32(out.subspan(map::kHeartbeat).first<2>(), heartbeat_);
  put_u32(out.subspan(map::kCommand).first<2>(), command_);
  put_u32(out.subspan(map::kCommandSequence).first<2>(), command_sequence_);
  return link_.exchange(map::kHeartbeat, request, map::kMagic, status);
}

bool ModbusSupervisor::take_status(std::span<const std::uint16_t> status) {
  std::string wrong = map_trouble(status);
  const std::uint32_t age = heartbeat_ - u32(status, map::kHeartbeatEcho);
  if (wrong.empty() && age > kEchoPolls)
    wrong = fmt::format("the heartbeat stopped at {}: the program behind the server hangs",
                        u32(status, map::kHeartbeatEcho));
  const std::lock_guard lock(mutex_);
  if (!wrong.empty()) {
    trouble_ = fmt::format("{}: {}", to_string(link_.address()), wrong);
    return true;  // the link itself is good: keep polling
  }
  trouble_.clear();
  snapshot_ = parse(status);
  if (wanted_ && sent_ && u32(status, map::kCommandEcho) == command_sequence_) {
    const bool accepted = u32(status, map::kCommandReply) == map::kReplyAccepted;
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
