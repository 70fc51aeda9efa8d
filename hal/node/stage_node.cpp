#include "hal/node/stage_node.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "excitation/words/require.hpp"
#include "hal/stage/peer_status.hpp"
#include "hal/stage/plant_watch.hpp"

namespace stageid {
namespace {

constexpr double kWatchdogSamples = 3.0;
// Leaky bucket of the samples that the node itself controls, as that of the host: six in a row are too many.
constexpr int kBadSample = 2;
constexpr int kMissesAllowed = 10;

std::int64_t nanoseconds(double seconds, const char* name) {
  require(seconds >= 0.0 && std::isfinite(seconds), "node: {} must be 0 or more; got {}", name,
          seconds);
  return std::llround(1e9 * seconds);
}

struct PanelTrouble {
  FaultCause cause = FaultCause::none;
  std::string message;
};

PanelTrouble trouble_of(const NodePanel& panel) {
  if (!panel.interlock_closed) return {FaultCause::interlock, "the interlock is open; close it"};
  const std::string gravity = range_trouble(panel.gravity_compensator_n, panel.gravity_low_n,
                                            panel.gravity_high_n, "gravity compensator", "N");
  if (!gravity.empty()) return {FaultCause::gravity, gravity};
  for (std::size_t i = 0; i < panel.temperature_k.size(); ++i)
    if (!(panel.temperature_k[i] <= panel.temperature_high_k))
      return {FaultCause::temperature,
              fmt::format("temperature {}: {:.4g} K is out of range (at most {:.4g} K)", i + 1,
                          panel.temperature_k[i], panel.temperature_high_k)};
  return {};
}

std::string refusal(SupervisorCommand command, NodeState state) {
  const bool in_fault = state == NodeState::fault;
  const char* remedy = in_fault ? "reset the fault first" : "wait, or end the measurement first";
  return fmt::format("{} is not allowed in state {}; {}", to_string(command), to_string(state),
                     remedy);
}

}  // namespace

StageNode::StageNode(std::unique_ptr<CyclicStage> stage, const StageLimits& limits,
                     const MotionControllerSpec& controller, NodePanel panel,
                     const NodeOptions& options)
    : stage_(std::move(stage), limits), controller_(controller), panel_(std::move(panel)) {
  stage_.carry(controller);
  const StageInfo& info = stage_.info();
  require(controller_.sensors() == static_cast<Eigen::Index>(info.sensors.size()) &&
              controller_.actuators() == static_cast<Eigen::Index>(info.actuators.size()),
          "node: the controller has {} sensors and {} actuators, the stage {} and {}",
          controller_.sensors(), controller_.actuators(), info.sensors.size(),
          info.actuators.size());
  const double watchdog_s =
      options.watchdog_s == 0.0 ? kWatchdogSamples / info.sample_rate_hz : options.watchdog_s;
  watchdog_ns_ = nanoseconds(watchdog_s, "watchdog_s");
  hold_ns_ = nanoseconds(options.hold_s, "hold_s");
  y_.assign(info.sensors.size(), 0.0);
  control_.assign(info.actuators.size(), 0.0);
  command_.assign(info.actuators.size(), 0.0);
  machine_.self_test_passed();  // the constructor has checked stage, limits and controller
}

std::string StageNode::trouble() const {
  const std::lock_guard lock(mutex_);
  if (machine_.cause() == FaultCause::none) return "";
  return reason_.empty() ? to_string(machine_.cause()) : reason_;
}

SupervisorReply StageNode::request(SupervisorCommand command) {
  const std::lock_guard lock(mutex_);
  if (machine_.state() != NodeState::operation_enabled) reserved_ = false;
  const bool needs_panel =
      command == SupervisorCommand::enable || command == SupervisorCommand::reset_fault;
  const PanelTrouble trouble = trouble_of(panel_);
  if (needs_panel && trouble.cause != FaultCause::none) return {false, trouble.message};
  if (!machine_.request(command)) return {false, refusal(command, machine_.state())};
  if (command == SupervisorCommand::reset_fault) reason_.clear();
  return {true, ""};
}

// A run or reservation can end in many ways, all of which change the state.
std::uint32_t StageNode::holder() const {
  const NodeState state = machine_.state();
  const bool held =
      state == NodeState::measuring || (reserved_ && state == NodeState::operation_enabled);
  return held ? session_ : 0;
}

// The low byte identifies the run in each CAN frame: not 0, and not that of the previous run.
std::uint32_t StageNode::draw_key() {
  std::uint32_t key = 0;
  do key = random_();
  while ((key & 0xFFU) == 0 || (key & 0xFFU) == (session_ & 0xFFU));
  return key;
}

std::uint32_t StageNode::reserve() {
  const std::lock_guard lock(mutex_);
  if (holder() != 0) refuse(PeerStatus::held, "node", "; wait until it has ended");
  session_ = draw_key();
  reserved_ = true;
  return session_;
}

std::uint32_t StageNode::begin_run(std::uint64_t run_seed, std::int64_t now_ns, Inputs& first,
                                   std::uint32_t session) {
  const std::lock_guard lock(mutex_);
  if (holder() != 0 && (session != holder() || running_))
    refuse(PeerStatus::held, "node", "; wait until it has ended");
  require<StageError>(machine_.state() == NodeState::operation_enabled,
                      "node: cannot measure in state {}; enable it first",
                      to_string(machine_.state()));
  require<StageError>(first.y.size() == y_.size(),
                      "node: Inputs::y must have one entry per sensor");
  stage_.start(run_seed, first);
  if (holder() == 0) session_ = draw_key();
  static_cast<void>(machine_.begin_measuring());
  reserved_ = false;
  running_ = true;
  sample_ = 0;
  bucket_ = 0;
  last_sample_ns_ = now_ns;
  hold_began_ns_.reset();
  silent_samples_ = 0;
  std::fill(command_.begin(), command_.end(), 0.0);
  std::copy(first.y.begin(), first.y.end(), y_.begin());
  controller_.reset();
  controller_.update(y_.data(), control_.data());
  first.node_state = machine_.state();
  return session_;
}

Outcome StageNode::advance_excited(std::int64_t now_ns, std::span<const double> r,
                                   std::span<double> u, Inputs& inputs) {
  const std::lock_guard lock(mutex_);
  if (r.size() != control_.size() || u.size() != control_.size()) {
    give_nothing(inputs);
    return Outcome::fault;
  }
  std::transform(control_.begin(), control_.end(), r.begin(), u.begin(), std::plus<>());
  const Outcome outcome = exchange(now_ns, u, inputs);
  std::copy(inputs.applied.begin(), inputs.applied.end(), u.begin());
  if (!lost(outcome) || machine_.state() != NodeState::measuring) return outcome;
  machine_.fail(FaultCause::amplifier);
  reason_ = "the stage gives no measurements";
  inputs.node_state = machine_.state();
  return Outcome::fault;
}

/// Whether too many measurements are missing to control the stage.
bool StageNode::lost(Outcome outcome) noexcept {
  const bool missing =
      outcome == Outcome::stale || outcome == Outcome::incomplete || outcome == Outcome::corrupt;
  bucket_ = missing ? bucket_ + kBadSample : std::max(0, bucket_ - 1);
  return bucket_ > kMissesAllowed;
}

void StageNode::give_nothing(Inputs& inputs) const {
  inputs.valid = 0;
  inputs.node_state = machine_.state();
}

Outcome StageNode::exchange(std::int64_t now_ns, std::span<const double> u, Inputs& inputs) {
  if (machine_.state() != NodeState::measuring || inputs.y.size() != y_.size()) {
    give_nothing(inputs);
    return Outcome::fault;
  }
  last_sample_ns_ = now_ns;
  std::copy(u.begin(), u.end(), command_.begin());
  Outcome outcome = stage_.exchange({sample_, command_}, inputs, {});
  // The host need not distinguish how the node stops; either way it stops by itself.
  if (outcome == Outcome::braking || outcome == Outcome::opened) outcome = Outcome::limit;
  ++sample_;
  std::copy(inputs.y.begin(), inputs.y.end(), y_.begin());
  controller_.update(y_.data(), control_.data());
  if (outcome == Outcome::limit) {
    const bool no_number = stage_.violation().kind == LimitKind::not_finite;
    machine_.fail(no_number ? FaultCause::not_finite : FaultCause::limit);
    reason_ = describe(stage_.violation(), stage_.info());
  } else if (ends_run(outcome)) {
    machine_.fail(FaultCause::amplifier);
  }
  inputs.node_state = machine_.state();
  return outcome;
}

void StageNode::end_run(bool keep_reserved) {
  const std::lock_guard lock(mutex_);
  if (machine_.state() != NodeState::measuring) return;  // a safe stop ends by itself
  come_to_rest();
  machine_.end_measuring();
  reserved_ = keep_reserved;
}

void StageNode::tick(std::int64_t now_ns) {
  const std::lock_guard lock(mutex_);
  const PanelTrouble panel = trouble_of(panel_);
  if (panel.cause != FaultCause::none && machine_.powered() &&
      machine_.cause() == FaultCause::none) {
    machine_.fail(panel.cause);
    reason_ = panel.message;
  }
  if (machine_.state() == NodeState::measuring && now_ns - last_sample_ns_ > watchdog_ns_) {
    machine_.fail(FaultCause::watchdog);
    silent_samples_ = samples_in(watchdog_ns_);
  }
  if (machine_.state() == NodeState::quick_stop || machine_.state() == NodeState::fault_reaction)
    hold(now_ns);
}

std::int64_t StageNode::samples_in(std::int64_t time_ns) const {
  return static_cast<std::int64_t>(1e-9 * static_cast<double>(time_ns) *
                                   stage_.info().sample_rate_hz);
}

// Plays the samples due since the last tick, including those of a late tick.
void StageNode::hold(std::int64_t now_ns) {
  if (!hold_began_ns_) {
    hold_began_ns_ = now_ns;
    held_samples_ = 0;
  }
  const std::int64_t elapsed_ns = std::min(now_ns - *hold_began_ns_, hold_ns_);
  const std::int64_t due = silent_samples_ + samples_in(elapsed_ns);
  Inputs inputs;
  inputs.y = y_;
  bool controlled = running_;
  for (; controlled && held_samples_ < due; ++held_samples_) {
    if (held_samples_ >= silent_samples_)
      std::copy(control_.begin(), control_.end(), command_.begin());
    // The limits need the cycle: a loop that does not settle is opened.
    const std::uint64_t cycle = sample_ + static_cast<std::uint64_t>(held_samples_);
    const Outcome outcome = stage_.exchange({cycle, command_}, inputs, {});
    controller_.update(y_.data(), control_.data());
    controlled = outcome != Outcome::fault && outcome != Outcome::link_down &&
                 outcome != Outcome::opened && !lost(outcome);
  }
  if (controlled && elapsed_ns < hold_ns_) return;
  come_to_rest();
  machine_.at_rest();
}

void StageNode::come_to_rest() {
  stage_.stop();
  const Emergency& emergency = stage_.emergency();
  if (emergency.cause.kind != LimitKind::none)
    reason_ =
        machine_.cause() == FaultCause::watchdog
            ? fmt::format("{}; its last force moved the stage too far; {}",
                          to_string(machine_.cause()), emergency.braked ? "braked" : "not braked")
            : describe_stop(stage_);
  running_ = false;
  hold_began_ns_.reset();
}

}  // namespace stageid
