#include "hal/modbus_stage.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <utility>

#include "hal/modbus_codec.hpp"
#include "hal/modbus_map.hpp"
#include "hal/supervisor.hpp"

namespace stageid {

namespace map = modbus_map;

namespace {

constexpr std::size_t kSetpointHead = map::kSetpoint - map::kSetpointSequence;
constexpr std::size_t kMeasurementHead = map::kMeasurement - map::kMeasurementBootId;

std::span<const std::uint16_t, 2> pair_at(const std::vector<std::uint16_t>& block, int offset) {
  return std::span<const std::uint16_t>(block).subspan(static_cast<std::size_t>(offset)).first<2>();
}

NodeState state_of(std::uint32_t status) { return static_cast<NodeState>((status >> 8) & 0xFFU); }
FaultCause cause_of(std::uint32_t status) {
  return static_cast<FaultCause>((status >> 16) & 0xFFU);
}

struct Exchange {
  int written = 0;  // registers
  int read = 0;
};

Exchange exchange_of(const StageInfo& info) {
  return {static_cast<int>(kSetpointHead + 2 * info.actuators.size()),
          static_cast<int>(kMeasurementHead + 2 * info.sensors.size())};
}

double checked_rate_hz(const StageInfo& info, const ModbusAddress& address,
                       const ModbusTiming& timing) {
  if (info.actuators.size() > map::kMostChannels || info.sensors.size() > map::kMostChannels)
    throw std::invalid_argument(
        fmt::format("modbus: {} actuators and {} sensors; one transaction carries {} of each",
                    info.actuators.size(), info.sensors.size(), map::kMostChannels));
  const double longest_hz = 1.0 / modbus_exchange_s(address, timing, info);
  const auto [written, read] = exchange_of(info);
  if (info.sample_rate_hz > longest_hz)
    throw std::invalid_argument(fmt::format(
        "modbus: {:.6g} Hz is faster than the link: one transaction takes {}, so {:.3g} "
        "Hz at most; lower sample_rate_hz or take a faster link",
        info.sample_rate_hz, describe_transaction(address, timing, written, read),
        std::floor(longest_hz)));
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
  request_.assign(kSetpointHead + 2 * info_.actuators.size(), 0);
  reply_.assign(kMeasurementHead + 2 * info_.sensors.size(), 0);
}

std::uint32_t ModbusStage::measured(int address) const noexcept {
  return get_u32(pair_at(reply_, address - map::kMeasurementBootId));
}

void ModbusStage::start(std::uint64_t run_seed, Inputs& first) {
  if (first.y.size() != info_.sensors.size())
    throw std::invalid_argument("modbus stage: Inputs::y must have one entry a sensor");
  trouble_ = Trouble::none;
  if (!link_.connected()) {
    link_.connect();
    description_ = read_description(link_, info_);
  }
  if (std::exchange(reset_fault_, false) && read_state(link_) == NodeState::fault)
    give_supervisor_command(link_, SupervisorCommand::reset_fault);
  if (!read_enabled(link_)) {
    give_supervisor_command(link_, SupervisorCommand::enable);
    enabled_here_ = true;
  }
  run_sequence_ = give_run_command(link_, map::kRunBegin, run_seed, reply_);
  if (measured(map::kMeasurementStatus) % 256 != static_cast<std::uint32_t>(Outcome::ok)) {
    const std::uint32_t status = measured(map::kMeasurementStatus);
    throw StageError(fmt::format("{}: no measurement in state {} ({}); reset or enable it first",
                                 to_string(link_.address()), to_string(state_of(status)),
                                 to_string(cause_of(status))));
  }
  sequence_ = 0;
  running_ = true;
  const Pacer::Instant now = pacer_.restart();
  first.cycle = 0;
  first.t_sample_ns = now.sample_ns;
  first.t_rx_ns = now.now_ns;
  static_cast<void>(take_measurement(first));
}

bool ModbusStage::write_setpoint(const Outputs& outputs) noexcept {
  put_u32(std::span(request_).first<2>(), sequence_);
  for (std::size_t i = 0; i < outputs.u.size(); ++i) {
    if (!fits_counts(outputs.u[i], description_.actuator_scale[i])) return false;
    put_i32(std::span(request_).subspan(kSetpointHead + 2 * i).first<2>(),
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
  const Outcome link = transact();
  const Pacer::Instant now = pacer_.wait();
  inputs.cycle = sequence_;
  inputs.t_ready_ns = now.ready_ns;
  inputs.t_sample_ns = now.sample_ns;
  inputs.t_rx_ns = now.now_ns;
  if (link != Outcome::ok && link != Outcome::late) return link;
  const Outcome stage = take_measurement(inputs);
  if (stage != Outcome::ok) return stage;
  const bool past_deadline = deadline.t_ns != 0 && now.now_ns > deadline.t_ns;
  return link == Outcome::late || now.late || past_deadline ? Outcome::late : Outcome::ok;
}

Outcome ModbusStage::transact() noexcept {
  Outcome outcome =
      judge(link_.exchange(map::kSetpointSequence, request_, map::kMeasurementBootId, reply_));
  if (outcome == Outcome::ok || trouble_ == Trouble::restarted || !link_.connected())
    return outcome;
  link_.drain();
  outcome =
      judge(link_.exchange(map::kSetpointSequence, request_, map::kMeasurementBootId, reply_));
  return outcome == Outcome::ok ? Outcome::late : outcome;
}

Outcome ModbusStage::judge(LinkStatus status) noexcept {
  trouble_ = status == LinkStatus::ok ? Trouble::none : Trouble::link;
  link_trouble_ = link_.last();
  switch (status) {
    case LinkStatus::ok:
      return judge_reply();
    case LinkStatus::timeout:
    case LinkStatus::disconnected:
      return Outcome::link_down;
    case LinkStatus::corrupt:
      return Outcome::corrupt;
    case LinkStatus::refused:
      break;
  }
  return Outcome::fault;
}

Outcome ModbusStage::judge_reply() noexcept {
  const std::uint32_t boot_id = measured(map::kMeasurementBootId);
  if (boot_id == description_.boot_id && measured(map::kMeasurementSequence) == sequence_ &&
      measured(map::kRunEcho) == run_sequence_)
    return Outcome::ok;
  // Zeros are what other devices show; a node that is there but new has a boot id of its own.
  const bool restarted = boot_id != description_.boot_id && boot_id != 0;
  trouble_ = restarted ? Trouble::restarted : Trouble::foreign_reply;
  return restarted ? Outcome::link_down : Outcome::corrupt;
}

Outcome ModbusStage::take_measurement(Inputs& inputs) noexcept {
  node_status_ = measured(map::kMeasurementStatus);
  inputs.node_state = state_of(node_status_);
  inputs.valid =
      (static_cast<std::uint64_t>(measured(map::kValid)) << 32) | measured(map::kValid + 2);
  for (std::size_t i = 0; i < inputs.y.size(); ++i)
    inputs.y[i] = description_.sensor_scale[i] *
                  get_i32(pair_at(reply_, static_cast<int>(kMeasurementHead + 2 * i)));
  const auto outcome = static_cast<Outcome>(node_status_ & 0xFFU);
  if (outcome != Outcome::ok) trouble_ = Trouble::node;
  return outcome > Outcome::limit ? Outcome::fault : outcome;
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
  // A node that is new, or gone, does not know of this run.
  if (trouble_ == Trouble::restarted) link_.close();
  if (!link_.connected()) return;
  if (trouble_ != Trouble::none) link_.drain();
  static_cast<void>(give_run_command(link_, map::kRunEnd, 0, reply_));
  if (std::exchange(enabled_here_, false) && read_enabled(link_))
    give_supervisor_command(link_, SupervisorCommand::disable);
}

std::string ModbusStage::trouble() const {
  switch (trouble_) {
    case Trouble::none:
      return "";
    case Trouble::link:
      return link_.describe(link_trouble_);
    case Trouble::restarted:
      return fmt::format("{}: the node was restarted", to_string(link_.address()));
    case Trouble::foreign_reply:
      return fmt::format("{}: replies do not belong to the setpoints: another unit or program",
                         to_string(link_.address()));
    case Trouble::node:
      return fmt::format("{}: the stage is in state {}: {}", to_string(link_.address()),
                         to_string(state_of(node_status_)), to_string(cause_of(node_status_)));
    case Trouble::not_carried:
      return "a command is not finite or beyond the range of the wire (the node's actuator scale)";
  }
  return "";
}

}  // namespace stageid
