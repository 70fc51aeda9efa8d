#include "hal/can/can_stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/can/can_bus_load.hpp"

namespace stageid {
namespace {

constexpr int kStartAttempts = 3;
constexpr std::int64_t kStampEra_ns = 65'536'000;  // of the node's time in its frames
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

StageInfo info_of(StageInfo info, const CanSpec& spec, const CanLayout& layout, double pace) {
  require_bus_carries(spec, layout, info.sample_rate_hz);
  info.backend = "can";
  info.clock = pace > 0.0 ? Clock::wall : Clock::virtual_time;
  info.pace = pace > 0.0 ? pace : 1.0;
  info.stamps = pace > 0.0;
  info.sets_pace = spec.node_clock;
  require(!spec.node_clock || pace == 1.0,
          "can: clock: node needs the wall clock; set pace: 1, or clock: host");
  return info;
}

}  // namespace

CanStage::CanStage(StageInfo info, const CanSpec& spec, std::unique_ptr<CanTransport> transport,
                   const CanHostOptions& options)
    : info_(std::move(info)),
      layout_(can_layout(spec, info_)),
      transport_(std::move(transport)),
      link_(*transport_, layout_.fingerprint, options.interrupted),
      pacer_(info_.sample_rate_hz, options.pace),
      wall_(options.pace > 0.0),
      reset_fault_(options.reset_fault),
      reply_timeout_ns_(std::llround(1e9 * spec.reply_timeout_s)),
      host_of_node_(std::llround(5e8 / info_.sample_rate_hz)),
      outbox_(layout_.setpoints.size()),
      inbox_(kCanInboxFrames) {
  info_ = info_of(std::move(info_), spec, layout_, options.pace);
  period_ns_ = std::llround(1e9 / (info_.sample_rate_hz * info_.pace));
  answers_.resize(layout_.sensors.size());
  fresh_.assign(info_.sensors.size(), kNone);
  decoded_.assign(info_.sensors.size(), kNone);
}

void CanStage::connect() { static_cast<void>(link_.greet(std::exchange(reset_fault_, false))); }

void CanStage::start(std::uint64_t run_seed, Inputs& first) {
  trouble_at_stop_.clear();
  connect();
  link_.forget_session();
  samples_bad_ = 0;
  conflict_ = false;
  stopped_by_ = PeerStatus::good;
  std::fill(answers_.begin(), answers_.end(), CanFrame{});
  not_carried_ = false;
  const CanLink::Other take_value = [this](const CanFrame& frame) { take(frame); };
  for (int attempt = 0; attempt < kStartAttempts; ++attempt) {
    begin_cycle(0);
    link_.command({.code = CanCommandCode::start, .a = run_seed}, take_value);
    states_before_ = link_.states();
    if (!complete()) collect(transport_->now_ns() + reply_timeout_ns_);
    if (complete()) break;
  }
  give(first);
  if (!complete()) {
    stop();
    throw StageError(fmt::format(
        "can: {}: the node started, but its measurements do not arrive; check all buses",
        transport_->name(0)));
  }
  if ((first.valid & all_sensors()) != all_sensors()) {
    stop();
    refuse(PeerStatus::first_sample_missing, fmt::format("can: {}", transport_->name(0)),
           fmt::format("; check sensor '{}'", info_.sensors[std::countr_one(first.valid)].name));
  }
  running_ = true;
  stamped_ns_ = arrival_ns_;
  stamped_us_ = node_us_;
  node_ns_ = kStampEra_ns + 1000 * std::int64_t{node_us_};
  node_time_ = NodeTime::unknown;
  host_of_node_.restart();
  instant_ns_ = transport_->now_ns();
  const Pacer::Instant now =
      info_.sets_pace ? Pacer::Instant{instant_ns_, instant_ns_, 0, false} : pacer_.restart();
  now.put(0, first);
}

void CanStage::begin_cycle(std::uint16_t sequence) noexcept {
  expected_ = sequence;
  frames_seen_ = 0;
  frames_missing_ = layout_.sensors.size();
  damaged_in_cycle_ = false;
  out_of_range_ = false;
  states_before_ = link_.states();
  std::fill(fresh_.begin(), fresh_.end(), kNone);
}

bool CanStage::send_setpoints(const Outputs& outputs) noexcept {
  const CanHeader header{expected_, 0, can_run(link_.session()), can_tag(link_.session())};
  bool carried = true;
  for (std::size_t i = 0; i < layout_.setpoints.size(); ++i) {
    const CanConversions lost = encode_can_values(layout_.setpoints[i], layout_.actuator_scale,
                                                  outputs.u, header, outbox_[i]);
    counts_.saturated += lost.saturated;
    carried &= lost.saturated + lost.no_number == 0;
  }
  not_carried_ |= !carried;
  if (carried) static_cast<void>(transport_->send(outbox_));
  return carried;
}

Outcome CanStage::exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept {
  inputs.valid = 0;
  if (!running_ || outputs.u.size() != info_.actuators.size() ||
      inputs.y.size() != info_.sensors.size())
    return Outcome::fault;
  begin_cycle(static_cast<std::uint16_t>(outputs.cycle + 1));
  if (!send_setpoints(outputs)) return Outcome::fault;  // the sent value would differ
  const std::int64_t ready_ns = transport_->now_ns();
  collect(reply_deadline_ns(deadline));
  for (int repeat = 0; !wall_ && repeat < kCanRepeats && !complete() && !over(); ++repeat) {
    ++counts_.repeats;
    static_cast<void>(transport_->send(outbox_));
    collect(transport_->now_ns() + reply_timeout_ns_);
  }
  give(inputs);
  status_ = judge(inputs);
  if (meaning(status_).reaction == PeerReaction::stop && stopped_by_ == PeerStatus::good)
    stopped_by_ = status_;
  const Outcome outcome = meaning(status_).outcome;
  samples_bad_ += status_ == PeerStatus::good ? 0U : 1U;
  if (wall_ && frames_seen_ != 0) stamp(inputs);
  // A node that sets the pace has waited; without an answer, the next instant follows a period after the last.
  if (info_.sets_pace && frames_seen_ == 0) instant_ns_ += period_ns_;
  const Pacer::Instant now =
      info_.sets_pace ? Pacer::Instant{instant_ns_, transport_->now_ns(), ready_ns, false}
                      : pacer_.wait();
  now.put(outputs.cycle + 1, inputs);
  return outcome == Outcome::ok && now.too_late(deadline) ? Outcome::late : outcome;
}

/// The node's time has 16 bits. The arrival time shows how often it has wrapped around.
void CanStage::stamp(Inputs& inputs) noexcept {
  inputs.t_arrival_ns = arrival_ns_;
  const auto step_us = static_cast<std::uint16_t>(node_us_ - stamped_us_);
  const std::int64_t left_ns = (arrival_ns_ - stamped_ns_) - 1000 * std::int64_t{step_us};
  const std::int64_t eras =
      (left_ns + kStampEra_ns / 2) / kStampEra_ns - (left_ns < -kStampEra_ns / 2);
  if (node_time_ == NodeTime::unknown)
    node_time_ = step_us == 0 && eras <= 0 ? NodeTime::none : NodeTime::runs;
  node_ns_ += 1000 * std::int64_t{step_us} + std::max<std::int64_t>(0, eras) * kStampEra_ns;
  stamped_ns_ = arrival_ns_;
  stamped_us_ = node_us_;
  inputs.stamp_of_stage = node_time_ == NodeTime::runs;
  inputs.stamp_ns = inputs.stamp_of_stage ? node_ns_ : arrival_ns_;
  if (!info_.sets_pace) return;
  static_cast<void>(host_of_node_.take(inputs.stamp_ns, arrival_ns_));
  instant_ns_ = host_of_node_.stamp_ns(inputs.stamp_ns);
}

std::int64_t CanStage::reply_deadline_ns(Deadline deadline) const noexcept {
  const std::int64_t now_ns = transport_->now_ns();
  // A late loop still grants the node one period to answer; otherwise it could never recover.
  if (wall_ && deadline.t_ns != 0) return std::max(deadline.t_ns, now_ns + period_ns_);
  return now_ns + reply_timeout_ns_;
}

/// Whether no further frames are expected in this cycle.
bool CanStage::over() const noexcept {
  return meaning(node_status()).reaction == PeerReaction::stop ||
         worst_bus(*transport_).state >= CanBusState::off;
}

// The deadline is checked on every iteration, because a bus may never be silent.
void CanStage::collect(std::int64_t until_ns) noexcept {
  while (true) {
    const std::size_t count = transport_->receive(inbox_);
    for (std::size_t i = 0; i < count; ++i)
      if (!link_.take(inbox_[i])) take(inbox_[i]);
    if (complete() || over() || transport_->now_ns() >= until_ns) return;
    if (count == 0) transport_->wait(until_ns);
  }
}

void CanStage::take(const CanFrame& frame) noexcept {
  const auto number = static_cast<std::size_t>(frame.id - kCanSensorId);
  if (frame.id < kCanSensorId || number >= layout_.sensors.size()) {
    ++counts_.foreign;
    return;
  }
  CanHeader header;
  if (!decode_can_values(layout_.sensors[number], layout_.sensor_scale, frame, header, decoded_)) {
    ++counts_.damaged;
    damaged_in_cycle_ = true;
    return;
  }
  if (link_.session() == 0 || header.run != can_run(link_.session())) {
    ++counts_.foreign;
    return;
  }
  // A repeated answer of one node is identical; a difference means two nodes.
  CanFrame& last = answers_[number];
  conflict_ |=
      last.length != 0 && header.sequence == get_can<std::uint16_t>(last, 0) &&
      !std::equal(frame.data.begin(), frame.data.begin() + frame.length, last.data.begin());
  const std::uint64_t bit = std::uint64_t{1} << number;
  if (header.sequence != expected_ || (frames_seen_ & bit) != 0) {
    ++counts_.old;
    return;
  }
  last = frame;
  if (frames_seen_ == 0) {
    arrival_ns_ = frame.t_rx_ns;
    node_us_ = header.detail;
  }
  frames_seen_ |= bit;
  --frames_missing_;
  measured_in_ = static_cast<NodeState>(header.kind & ~kCanSaturatedBit);
  out_of_range_ |= (header.kind & kCanSaturatedBit) != 0;
  for (const std::size_t channel : layout_.sensors[number].channels)
    fresh_[channel] = decoded_[channel];
}

void CanStage::give(Inputs& inputs) const noexcept {
  inputs.valid = 0;
  for (std::size_t i = 0; i < fresh_.size(); ++i) {
    if (std::isnan(fresh_[i])) continue;
    inputs.y[i] = fresh_[i];
    inputs.valid |= std::uint64_t{1} << i;
  }
  inputs.node_state = link_.states() != states_before_ ? link_.state().state : measured_in_;
}

/// Status from the node's state and measurement frames of this cycle.
PeerStatus CanStage::node_status() const noexcept {
  if (conflict_) return PeerStatus::conflict;
  if (link_.other_node()) return PeerStatus::other_node;
  PeerReport report{.valid = 1, .all = 1, .out_of_range = out_of_range_};
  if (frames_seen_ != 0) report.state = measured_in_;
  if (link_.states() != states_before_) {
    const CanState& node = link_.state();
    const bool of_this_run = node.run == can_run(link_.session());
    report.state = of_this_run ? node.state : NodeState::not_ready;
    report.cause = node.cause;
    report.setpoints_missed = node.gaps > samples_bad_;
  }
  return stageid::judge(report);
}

PeerStatus CanStage::judge(const Inputs& inputs) noexcept {
  using enum PeerStatus;
  constexpr std::array kOfBus = {good, good, passive, bus_off, link_down};
  PeerStatus worst =
      std::max(kOfBus[static_cast<std::size_t>(worst_bus(*transport_).state)], node_status());
  // Reported once: the gaps mark this sample only.
  if (link_.state().gaps > samples_bad_) samples_bad_ = link_.state().gaps;
  const std::uint64_t valid = inputs.valid & all_sensors();
  if (valid == all_sensors()) return worst;
  worst = std::max(worst, valid == 0 ? nothing_new : incomplete);
  return damaged_in_cycle_ ? std::max(worst, damaged) : worst;
}

void CanStage::stop() noexcept {
  try {
    if (running_) trouble_at_stop_ = trouble();
  } catch (const std::exception&) {  // out of memory: the text is optional
  }
  running_ = false;
  if (link_.session() == 0) return;  // the node has begun no run for this host
  // If there is no answer, the node's watchdog stops it.
  static_cast<void>(link_.try_command({CanCommandCode::stop}));
  link_.forget_session();
}

std::string CanStage::trouble() const {
  if (!running_) return trouble_at_stop_;
  if (not_carried_) return "a command is not finite or exceeds actuator_range_n";
  const WorstBus worst = worst_bus(*transport_);
  if (worst.state >= CanBusState::passive)
    return fmt::format("{}: {}", transport_->name(worst.bus), to_string(worst.state));
  // Frames that this host could not send are reported before the node's state.
  for (std::size_t bus = 0; bus < transport_->buses(); ++bus)
    if (transport_->health(bus).send_refused > 0)
      return fmt::format(
          "{}: {} frames were dropped because the send queue is full; the bus is too slow",
          transport_->name(bus), transport_->health(bus).send_refused);
  const CanState& node = link_.state();
  const PeerStatus status = stopped_by_ == PeerStatus::good ? status_ : stopped_by_;
  const PeerMeaning& said = meaning(status);
  const bool of_the_node = status <= PeerStatus::unknown_code;
  if (of_the_node && node.state != NodeState::measuring)
    return fmt::format("the node is in state {}{}", to_string(node.state),
                       link_.text().empty() ? "" : ": " + link_.text());
  if (said.reaction == PeerReaction::stop || status == PeerStatus::setpoints_missed)
    return said.words;
  if (!complete())
    return fmt::format(
        "the node did not answer sample {} in time ({} damaged, {} old, {} foreign frames so far)",
        expected_, counts_.damaged, counts_.old, counts_.foreign);
  return "";
}

}  // namespace stageid
