#include "hal/modbus/modbus_stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/modbus/modbus_encoding.hpp"
#include "hal/modbus/modbus_map.hpp"
#include "hal/stage/supervisor.hpp"

namespace stageid {

namespace map = modbus_map;

namespace {

constexpr std::size_t kSetpointHead = map::kSetpoint - map::kRunKey;
constexpr std::size_t kMeasurementHead = map::kMeasurement - map::kMeasurementBootId;

NodeState state_of(std::uint32_t status) { return static_cast<NodeState>((status >> 8) & 0xFFU); }
FaultCause cause_of(std::uint32_t status) {
  return static_cast<FaultCause>((status >> 16) & 0xFFU);
}

/// Numbers of registers that are written and read.
std::pair<int, int> exchange_of(const StageInfo& info) {
  return {static_cast<int>(kSetpointHead + 2 * info.actuators.size()),
          static_cast<int>(kMeasurementHead + 2 * info.sensors.size())};
}

double checked_rate_hz(const StageInfo& info, const ModbusAddress& address,
                       const ModbusTiming& timing) {
  map::require_channels(info);
  const double longest_hz = 1.0 / modbus_exchange_s(address, timing, info);
  const auto [written, read] = exchange_of(info);
  require(info.sample_rate_hz <= longest_hz,
          "modbus: {:.6g} Hz is too fast for the link: one transaction takes {}, so the maximum "
          "is {:.3g} Hz. Lower sample_rate_hz or use a faster link",
          info.sample_rate_hz, describe_transaction(address, timing, written, read),
          std::floor(longest_hz));
  return longest_hz;
}

}  // namespace

double modbus_exchange_s(const ModbusAddress& address, const ModbusTiming& timing,
                         const StageInfo& info) {
  const auto [written, read] = exchange_of(info);
  return modbus_transaction_s(address, timing, written, read);
}

ModbusStage::ModbusStage(StageInfo info, const ModbusAddress& address, const ModbusTiming& timing,
                         const ModbusHostOptions& options)
    : info_(std::move(info)),
      link_(address, timing),
      pacer_(info_.sample_rate_hz, options.pace),
      reset_fault_(options.reset_fault) {
  info_.backend = "modbus";
  info_.maximum_rate_hz = checked_rate_hz(info_, address, timing);
  info_.clock = options.pace > 0.0 ? Clock::wall : Clock::virtual_time;
  info_.pace = options.pace > 0.0 ? options.pace : 1.0;
  info_.stamps = options.pace > 0.0;
  request_.assign(kSetpointHead + 2 * info_.actuators.size(), 0);
  reply_.assign(kMeasurementHead + 2 * info_.sensors.size(), 0);
}

RegisterBlock<const std::uint16_t> ModbusStage::measured() const noexcept {
  return {map::kMeasurementBootId, reply_};
}

void ModbusStage::start(std::uint64_t run_seed, Inputs& first) {
  require(first.y.size() == info_.sensors.size(),
          "modbus stage: Inputs::y must have one entry per sensor");
  trouble_ = Trouble::none;
  stopped_by_ = PeerStatus::good;
  if (!link_.connected()) {
    link_.connect();
    description_ = read_description(link_, info_);
  }
  const ModbusState node = read_state(link_);
  const bool reset_fault = std::exchange(reset_fault_, false);
  if (node.state == NodeState::fault) {
    if (!reset_fault)
      refuse(PeerStatus::in_fault, to_string(link_.address()),
             fmt::format(" ({}{}); remove the cause and add --reset-fault", to_string(node.cause),
                         node.interlock_closed ? "" : "; the interlock is open"));
    give_supervisor_command(link_, SupervisorCommand::reset_fault);
  }
  if (!node.enabled) {
    give_supervisor_command(link_, SupervisorCommand::enable);
    enabled_here_ = true;
  }
  session_ = begin_run(link_, run_seed, reply_);
  sequence_ = 0;
  missed_ = 0;
  running_ = true;
  pacer_.restart().put(0, first);
  const PeerStatus status = status_ = take_measurement(first);
  if (status == PeerStatus::good) return;
  stop();
  const bool missing = status == PeerStatus::incomplete || status == PeerStatus::nothing_new;
  refuse(missing ? PeerStatus::first_sample_missing : status, to_string(link_.address()),
         "; check the node");
}

bool ModbusStage::write_setpoint(const Outputs& outputs) noexcept {
  const RegisterBlock request(map::kRunKey, request_);
  request.set_u32(map::kRunKey, session_);
  request.set_u32(map::kSetpointSequence, sequence_);
  for (std::size_t i = 0; i < outputs.u.size(); ++i) {
    if (!fits_counts(outputs.u[i], description_.actuator_scale[i])) return false;
    request.set_i32(map::kSetpoint + 2 * static_cast<int>(i),
                    to_counts(outputs.u[i], description_.actuator_scale[i]));
  }
  return true;
}

Outcome ModbusStage::exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept {
  inputs.valid = 0;
  if (!running_ || outputs.u.size() != info_.actuators.size() ||
      inputs.y.size() != info_.sensors.size())
    return Outcome::fault;
  ++sequence_;
  if (!write_setpoint(outputs)) {
    trouble_ = Trouble::not_carried;
    return Outcome::fault;
  }
  status_ = transact();
  if (status_ == PeerStatus::good) inputs.t_arrival_ns = inputs.stamp_ns = monotonic_ns();
  const Pacer::Instant now = pacer_.wait();
  now.put(sequence_, inputs);
  if (status_ == PeerStatus::good || status_ == PeerStatus::late)
    status_ = std::max(status_, take_measurement(inputs));
  if (status_ == PeerStatus::good && now.too_late(deadline)) status_ = PeerStatus::late;
  return meaning(status_).outcome;
}

PeerStatus ModbusStage::transact() noexcept {
  const auto once = [this] {
    return judge(link_.exchange(map::kRunKey, request_, map::kMeasurementBootId, reply_));
  };
  PeerStatus status = once();
  if (status == PeerStatus::good || status == PeerStatus::other_node || !link_.connected())
    return status;
  link_.drain();
  status = once();
  if (link_trouble_.status == LinkStatus::refused && restarted()) {
    trouble_ = Trouble::node;
    return PeerStatus::other_node;
  }
  return status == PeerStatus::good ? PeerStatus::late : status;
}

/// A restarted node refuses the unknown run; its boot id has changed.
bool ModbusStage::restarted() noexcept {
  std::array<std::uint16_t, 2> boot_id{};
  if (link_.read(map::kMeasurementBootId, boot_id) != LinkStatus::ok) return false;
  return RegisterBlock(0, boot_id).u32(0) != description_.boot_id;
}

PeerStatus ModbusStage::judge(LinkStatus status) noexcept {
  using enum PeerStatus;
  constexpr std::array kStatus = {good, link_down, damaged, fault, link_down, link_down};
  trouble_ = status == LinkStatus::ok ? Trouble::none : Trouble::link;
  link_trouble_ = link_.last();
  return status == LinkStatus::ok ? judge_reply() : kStatus[static_cast<std::size_t>(status)];
}

PeerStatus ModbusStage::judge_reply() noexcept {
  const std::uint32_t boot_id = measured().u32(map::kMeasurementBootId);
  if (boot_id == description_.boot_id && measured().u32(map::kMeasurementSequence) == sequence_ &&
      measured().u32(map::kSession) == session_)
    return PeerStatus::good;
  // Other devices return zeros, whereas a restarted node has a nonzero boot id of its own.
  const bool other = boot_id != description_.boot_id && boot_id != 0;
  trouble_ = other ? Trouble::node : Trouble::foreign_reply;
  return other ? PeerStatus::other_node : PeerStatus::damaged;
}

PeerStatus ModbusStage::take_measurement(Inputs& inputs) noexcept {
  node_status_ = measured().u32(map::kMeasurementStatus);
  inputs.node_state = state_of(node_status_);
  inputs.valid = measured().u64(map::kValid);
  PeerReport report;
  report.outcome = static_cast<std::uint8_t>(node_status_ & 0xFFU);
  report.state = inputs.node_state;
  report.cause = cause_of(node_status_);
  report.valid = inputs.valid;
  report.all = all_bits(inputs.y.size());
  report.setpoints_missed = node_status_ >> 24 > std::exchange(missed_, node_status_ >> 24);
  for (std::size_t i = 0; i < inputs.y.size(); ++i) {
    const std::int32_t count = measured().i32(map::kMeasurement + 2 * static_cast<int>(i));
    inputs.y[i] = description_.sensor_scale[i] * count;
    report.out_of_range |= std::abs(static_cast<double>(count)) >= kLargestModbusCount;
  }
  const PeerStatus status = stageid::judge(report);
  if (status != PeerStatus::good) trouble_ = Trouble::node;
  if (meaning(status).reaction == PeerReaction::stop && stopped_by_ == PeerStatus::good) {
    stopped_by_ = status;
    node_status_at_stop_ = node_status_;
  }
  return status;
}

void ModbusStage::stop() noexcept {
  if (!running_) return;
  running_ = false;
  try {
    end_run();
  } catch (...) {
    link_.close();  // the node's watchdog brings the stage to rest
  }
}

void ModbusStage::end_run() {
  // A restarted or missing node does not know this run.
  if (status_ == PeerStatus::other_node) link_.close();
  if (!link_.connected()) return;
  if (trouble_ != Trouble::none) link_.drain();
  stageid::end_run(link_, session_, reply_);
  if (std::exchange(enabled_here_, false) && read_state(link_).enabled)
    give_supervisor_command(link_, SupervisorCommand::disable);
}

std::string ModbusStage::describe_report(PeerStatus status, std::uint32_t node_status) const {
  return fmt::format("{}: {} (state {}, cause: {})", to_string(link_.address()),
                     meaning(status).words, to_string(state_of(node_status)),
                     to_string(cause_of(node_status)));
}

std::string ModbusStage::trouble() const {
  if (stopped_by_ != PeerStatus::good) return describe_report(stopped_by_, node_status_at_stop_);
  switch (trouble_) {
    case Trouble::none:
      return "";
    case Trouble::link:
      return link_.describe(link_trouble_);
    case Trouble::foreign_reply:
      return fmt::format("{}: {}", to_string(link_.address()), kForeignReplies);
    case Trouble::node:
      return describe_report(status_, node_status_);
    case Trouble::not_carried:
      return "a command is not finite or exceeds the range of the node's actuator scale";
  }
  return "";
}

}  // namespace stageid
