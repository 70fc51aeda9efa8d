#include "hal/modbus/modbus_node.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "excitation/words/require.hpp"
#include "hal/stage/pacer.hpp"

namespace stageid {

namespace map = modbus_map;

namespace {

constexpr double kHeadroom = 2.0;
constexpr std::uint32_t kMostMissed = 255;

bool touches(int first, std::size_t count, int address) {
  return first < address + 2 && address < first + static_cast<int>(count);
}

void check_sizes(const StageNode& node) {
  map::require_channels(node.info());
  const NodePanel panel = node.panel();
  require(panel.gravity_compensator_n.size() <= map::kMostPanelValues &&
              panel.temperature_k.size() <= map::kMostPanelValues,
          "modbus: {} gravity compensators and {} temperatures; the register map has at most {} "
          "of each",
          panel.gravity_compensator_n.size(), panel.temperature_k.size(), map::kMostPanelValues);
}

void check_faults(const ModbusFaultScript* faults, const NodePanel& panel) {
  using Kind = ModbusFault::Kind;
  if (faults == nullptr) return;
  require(!faults->mentions(Kind::temperature) || !panel.temperature_k.empty(),
          "fault 'temperature': the stage file has no temperature");
  require(!faults->mentions(Kind::gravity) || !panel.gravity_compensator_n.empty(),
          "fault 'gravity': the stage file has no gravity compensator");
}

}  // namespace

std::vector<float> modbus_scales(const Eigen::VectorXd& limits, std::size_t channels,
                                 const char* what) {
  require(static_cast<std::size_t>(limits.size()) == channels,
          "modbus: every {} needs a limit, because the limit sets its range in the registers",
          what);
  std::vector<float> scales;
  for (const double limit : limits) scales.push_back(count_scale(kHeadroom * limit));
  return scales;
}

ModbusNode::ModbusNode(StageNode& node, const StageLimits& limits, std::uint32_t boot_id,
                       ModbusFaultScript* faults, double heartbeat_s)
    : node_(node),
      faults_(faults),
      boot_id_(boot_id),
      heartbeat_ns_(std::llround(1e9 * heartbeat_s)),
      undisturbed_(node.panel()) {
  check_sizes(node);
  check_faults(faults, undisturbed_);
  describe_stage(limits);
  u_.assign(actuator_scale_.size(), 0.0);
  y_.assign(sensor_scale_.size(), 0.0);
  inputs_.y = y_;
  map_.set_u32(map::kMeasurementBootId, boot_id_);
}

void ModbusNode::describe_stage(const StageLimits& limits) {
  const StageInfo& info = node_.info();
  map_.set_u32(map::kMagic, map::kMagicValue);
  map_.set_u32(map::kVersion, map::kVersionValue);
  map_.set_u32(map::kBootId, boot_id_);
  map_.set_u32(map::kActuatorCount, static_cast<std::uint32_t>(info.actuators.size()));
  map_.set_u32(map::kSensorCount, static_cast<std::uint32_t>(info.sensors.size()));
  map_.set_f32(map::kSampleRate, static_cast<float>(info.sample_rate_hz));
  map_.set_u32(map::kChannelHash, map::channel_hash(info));
  const auto show = [&](const std::vector<float>& scales, int address, std::vector<double>& out) {
    for (const float scale : scales) {
      map_.set_f32(address + 2 * static_cast<int>(out.size()), scale);
      out.push_back(static_cast<double>(scale));
    }
  };
  show(modbus_scales(limits.actuator_n, info.actuators.size(), "actuator"), map::kActuatorScale,
       actuator_scale_);
  show(modbus_scales(limits.position_window_m, info.sensors.size(), "sensor"), map::kSensorScale,
       sensor_scale_);
}

bool ModbusNode::on(ModbusFault::Kind kind) const noexcept {
  return faults_ != nullptr && faults_->active(kind) != nullptr;
}

void ModbusNode::begin_request(ModbusConnection from) {
  asking_ = from;
  disturb_panel();
  tick();
}

void ModbusNode::tick() {
  const std::int64_t now_ns = monotonic_ns();
  node_.tick(now_ns);
  const std::uint32_t heartbeat = map_.u32(map::kHeartbeat);
  const NodeState state = node_.state();
  const bool powered = state == NodeState::operation_enabled || state == NodeState::measuring;
  if (heartbeat != last_heartbeat_) {
    last_heartbeat_ = heartbeat;
    heartbeat_seen_ns_ = now_ns;
  } else if (!powered) {
    heartbeat_seen_ns_ = 0;
    counting_ = 0;
  } else if (heartbeat_seen_ns_ != 0 && now_ns - heartbeat_seen_ns_ > heartbeat_ns_) {
    node_.fail(FaultCause::host_heartbeat);
    heartbeat_seen_ns_ = 0;
    counting_ = 0;
  }
}

bool ModbusNode::needs(ModbusConnection connection) const {
  const bool runs = session_ != 0 && node_.session() == session_;
  return connection == counting_ || (runs && connection == owner_);
}

// The watchdogs react to the missing heartbeat or setpoints.
void ModbusNode::hung_up(ModbusConnection connection) {
  if (counting_ == connection) counting_ = 0;
}

void ModbusNode::disturb_panel() {
  using Kind = ModbusFault::Kind;
  if (faults_ == nullptr) return;
  NodePanel panel = undisturbed_;
  if (on(Kind::interlock)) panel.interlock_closed = false;
  if (const ModbusFault* fault = faults_->active(Kind::temperature); fault != nullptr)
    panel.temperature_k.at(0) = fault->value;
  if (const ModbusFault* fault = faults_->active(Kind::gravity); fault != nullptr)
    panel.gravity_compensator_n.at(0) = fault->value;
  const bool disturbed = on(Kind::interlock) || on(Kind::temperature) || on(Kind::gravity);
  // Several servers may share one node: only the one that disturbed the panel may restore it.
  if (disturbed || disturbed_) node_.set_panel(std::move(panel));
  disturbed_ = disturbed;
}

ModbusException ModbusNode::write(int first, std::span<const std::uint16_t> values) {
  if (first < 0 || first + static_cast<int>(values.size()) > map::kWritableEnd)
    return ModbusException::illegal_address;
  std::array<std::uint16_t, map::kWritableEnd> before{};
  std::copy_n(registers_.begin(), before.size(), before.begin());
  std::copy(values.begin(), values.end(), registers_.begin() + first);
  const ModbusException refused = obey(first, values.size(), {0, before});
  if (refused != ModbusException::none) std::copy(before.begin(), before.end(), registers_.begin());
  map_.set_u32(map::kRunKey, 0);  // the key must not be readable here
  return refused;
}

/// Acts on the changes between the previous values and the current registers.
ModbusException ModbusNode::obey(int first, std::size_t count,
                                 RegisterBlock<const std::uint16_t> before) {
  const auto is_new = [&](int address) { return map_.u32(address) != before.u32(address); };
  const bool beats = is_new(map::kHeartbeat);
  const bool runs = is_new(map::kRunSequence);
  const bool moves = touches(first, count, map::kSetpointSequence);
  const bool of_the_run = first + static_cast<int>(count) > map::kRunCommand;
  if (beats && counting_ != 0 && counting_ != asking_) return ModbusException::busy;
  if (of_the_run && !may_control_the_run(runs, moves)) return ModbusException::busy;
  if (runs)
    if (const ModbusException refused = take_run_command(); refused != ModbusException::none)
      return refused;
  if (beats) counting_ = asking_;
  if (is_new(map::kCommandSequence)) take_supervisor_command();
  if (moves) take_setpoint();
  return ModbusException::none;
}

bool ModbusNode::may_control_the_run(bool commands, bool moves) const {
  const std::uint32_t holder = node_.session();
  const bool began_it = session_ != 0 && asking_ == owner_ && (holder == 0 || holder == session_);
  if (began_it && map_.u32(map::kRunKey) == session_) return true;
  if (began_it && !commands && !moves) return true;  // a duplicate command
  return holder == 0 && commands && map_.u32(map::kRunCommand) == map::kRunBegin;
}

ModbusException ModbusNode::read(int first, std::span<std::uint16_t> values) {
  if (first < 0 || first + static_cast<int>(values.size()) > map::kEnd)
    return ModbusException::illegal_address;
  show_status();
  map_.set_u32(map::kSession, asking_ == owner_ ? session_ : 0);
  std::copy_n(registers_.begin() + first, values.size(), values.begin());
  return ModbusException::none;
}

void ModbusNode::take_supervisor_command() {
  const std::uint32_t command = map_.u32(map::kCommand);
  const bool known = command >= 1 && command <= 4;
  const bool accepted =
      known && node_.request(static_cast<SupervisorCommand>(command - 1)).accepted;
  map_.set_u32(map::kCommandEcho, map_.u32(map::kCommandSequence));
  map_.set_u32(map::kCommandReply, accepted ? map::kReplyAccepted : map::kReplyRefused);
}

ModbusException ModbusNode::take_run_command() {
  const std::uint32_t command = map_.u32(map::kRunCommand);
  if (command != map::kRunBegin && command != map::kRunEnd) return ModbusException::illegal_value;
  if (command == map::kRunBegin) {
    const ModbusException refused = begin_run();
    if (refused != ModbusException::none) return refused;
  } else {
    node_.end_run();
    inputs_.valid = 0;
    std::fill(y_.begin(), y_.end(), 0.0);
  }
  missed_ = 0;
  map_.set_u32(map::kSetpointSequence, 0);
  show_measurement(Outcome::ok, 0);
  return ModbusException::none;
}

ModbusException ModbusNode::begin_run() {
  try {
    session_ = node_.begin_run(map_.u64(map::kRunSeed), monotonic_ns(), inputs_);
  } catch (const StageError&) {  // the state and cause registers contain the reason
    return node_.session() != 0 ? ModbusException::busy : ModbusException::device_failure;
  }
  owner_ = asking_;
  return ModbusException::none;
}

void ModbusNode::take_setpoint() {
  const std::uint32_t sequence = map_.u32(map::kSetpointSequence);
  const std::uint32_t ahead = sequence - map_.u32(map::kMeasurementSequence);
  // Modular comparison: numbers up to 2^31 - 1 ahead are newer, all others older.
  if (ahead == 0 || ahead > 0x7FFFFFFFU) return;
  missed_ = std::min(kMostMissed, missed_ + (ahead - 1));
  for (std::size_t i = 0; i < u_.size(); ++i)
    u_[i] = actuator_scale_[i] * map_.i32(map::kSetpoint + 2 * static_cast<int>(i));
  show_measurement(node_.advance(monotonic_ns(), u_, inputs_), sequence);
}

void ModbusNode::show_measurement(Outcome outcome, std::uint32_t sequence) {
  map_.set_u32(map::kMeasurementSequence, sequence);
  const auto state = static_cast<std::uint32_t>(node_.state());
  const auto cause = static_cast<std::uint32_t>(node_.cause());
  map_.set_u32(map::kMeasurementStatus, static_cast<std::uint32_t>(outcome) | (state << 8) |
                                            (cause << 16) | (missed_ << 24));
  map_.set_u64(map::kValid, inputs_.valid);
  for (std::size_t i = 0; i < y_.size(); ++i)
    map_.set_i32(map::kMeasurement + 2 * static_cast<int>(i), to_counts(y_[i], sensor_scale_[i]));
}

void ModbusNode::show_status() {
  const NodePanel panel = node_.panel();
  const NodeState state = node_.state();
  const bool enabled = state == NodeState::operation_enabled || state == NodeState::measuring;
  if (!on(ModbusFault::Kind::heartbeat))
    map_.set_u32(map::kHeartbeatEcho, map_.u32(map::kHeartbeat));
  map_.set_u32(map::kState, static_cast<std::uint32_t>(state));
  map_.set_u32(map::kCause, static_cast<std::uint32_t>(node_.cause()));
  map_.set_u32(map::kFlags, (panel.interlock_closed ? map::kFlagInterlockClosed : 0U) |
                                (enabled ? map::kFlagEnabled : 0U));
  const auto show = [&](const std::vector<double>& values, int count_address, int address) {
    map_.set_u32(count_address, static_cast<std::uint32_t>(values.size()));
    for (std::size_t i = 0; i < values.size(); ++i)
      map_.set_f32(address + 2 * static_cast<int>(i), static_cast<float>(values[i]));
  };
  show(panel.gravity_compensator_n, map::kGravityCount, map::kGravity);
  show(panel.temperature_k, map::kTemperatureCount, map::kTemperature);
}

}  // namespace stageid
