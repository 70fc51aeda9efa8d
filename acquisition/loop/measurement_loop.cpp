#include "acquisition/loop/measurement_loop.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "excitation/words/require.hpp"
#include "hal/stage/pacer.hpp"

namespace stageid {

namespace {

constexpr int kBadCycle = 2;  // added to the bucket by a bad cycle; a good one subtracts 1

bool gives_measurement(Outcome outcome) noexcept {
  return outcome == Outcome::ok || outcome == Outcome::late || outcome == Outcome::bus_passive;
}

}  // namespace

MeasurementLoop::MeasurementLoop(CyclicStage& stage, MotionController& controller, SampleRing& ring,
                                 const LoopOptions& options)
    : stage_(stage),
      controller_(controller),
      ring_(ring),
      misses_allowed_(options.misses_allowed),
      sets_pace_(stage.info().sets_pace),
      jitter_ns_(std::llround(1e9 * options.jitter_s / stage.info().pace)),
      jitter_ns2_(std::pow(1e9 * options.jitter_rms_s / stage.info().pace, 2)),
      clock_(jitter_ns_,
             options.jitter_rms_s > 0.0 ? std::llround(std::sqrt(jitter_ns2_)) : jitter_ns_) {
  const StageInfo& info = stage.info();
  const std::size_t actuators = info.actuators.size();
  const std::size_t sensors = info.sensors.size();
  require(options.ramp_s >= 0.0 && std::isfinite(options.ramp_s) && options.misses_allowed >= 0 &&
              options.jitter_s >= 0.0 && options.jitter_rms_s >= 0.0,
          "loop: ramp_s, jitter_s, jitter_rms_s and misses_allowed must be 0 or more");
  if (static_cast<std::size_t>(controller.sensors()) != sensors ||
      static_cast<std::size_t>(controller.actuators()) != actuators)
    fail_request("loop: the controller has {} sensors and {} actuators, the stage {} and {}",
                 controller.sensors(), controller.actuators(), sensors, actuators);
  stamps_ = ring.row_words() == actuators + sensors + 2;
  if ((ring.row_words() != actuators + sensors + 1 && !stamps_) || sensors > 64)
    fail_request(
        "loop: a row has {} words for {} actuators, {} sensors (at most 64), a stamp word if there "
        "are any, and a status word",
        ring.row_words(), actuators, sensors);
  ramp_samples_ = static_cast<std::uint64_t>(std::llround(options.ramp_s * info.sample_rate_hz));
  hold_ = options.between_runs == BetweenRuns::hold;
  wall_clock_ = info.clock == Clock::wall;
  period_ns_ = std::llround(1e9 / (info.sample_rate_hz * info.pace));
  u_.assign(actuators, 0.0);
  last_finite_u_.assign(actuators, 0.0);
  y_.assign(sensors, 0.0);
  fresh_.assign(sensors, 0.0);
  landing_row_.assign(ring.row_words(), 0.0);
}

PreparedExcitation MeasurementLoop::prepare(const LoopExcitation& excitation) const {
  const Eigen::MatrixXd& period = excitation.period;
  require(period.rows() > 0 && excitation.samples > 0 && period.allFinite() &&
              period.cols() == std::ssize(excitation.actuators),
          "loop: the excitation must be finite, with at least one sample and one column per "
          "actuator");
  PreparedExcitation out;
  std::vector<Eigen::Index> columns;
  for (Eigen::Index c = 0; c < period.cols(); ++c) {
    const int actuator = excitation.actuators[c];
    if (actuator < 0 || static_cast<std::size_t>(actuator) >= u_.size())
      fail_request("loop: unknown actuator number {}", actuator);
    if (period.col(c).isZero(0.0)) continue;
    out.actuators.push_back(static_cast<std::size_t>(actuator));
    columns.push_back(c);
  }
  for (Eigen::Index n = 0; n < period.rows(); ++n) {
    for (const Eigen::Index c : columns) out.rows.push_back(period(n, c));
  }
  out.period_samples = static_cast<std::uint64_t>(period.rows());
  out.samples = excitation.samples;
  return out;
}

void MeasurementLoop::start(std::uint64_t run_seed, const LoopExcitation& excitation) {
  excitation_ = prepare(excitation);
  cycle_ = 0;
  bucket_ = 0;
  status_ = {};
  stamp_ = {};
  clock_.restart();
  std::fill(y_.begin(), y_.end(), 0.0);
  std::fill(last_finite_u_.begin(), last_finite_u_.end(), 0.0);
  controller_.reset();
  inputs_ = {};
  inputs_.y = fresh_;
  begin(controller_.feed_forward_samples());
  const Phase first = std::exchange(phase_, Phase::idle);
  stage_.start(run_seed, inputs_);
  phase_ = first;
  if (wall_clock_) awake_ns_ = monotonic_ns();
  tell_state();
  take_measurement(Outcome::ok);
  const std::uint64_t all = all_bits(y_.size());
  status_.marked |= (inputs_.valid & all) != all;
}

void MeasurementLoop::next(PreparedExcitation& excitation) noexcept {
  if (phase_ != Phase::holding) return;
  std::swap(excitation_, excitation);
  begin(0);
}

void MeasurementLoop::release() noexcept {
  if (phase_ != Phase::idle) end(reason_);  // a stop that was requested while it was held, too
}

/// The next run. `quiet_samples` pass without excitation.
void MeasurementLoop::begin(std::uint64_t quiet_samples) noexcept {
  ++run_;
  sample_ = 0;
  quiet_left_ = quiet_samples;
  ramp_left_ = hold_ ? ramp_samples_ : 0;
  // The phase continues from the ramp into the first recorded sample, which begins the period.
  const std::uint64_t period = excitation_.period_samples;
  phase_sample_ = (period - ramp_left_ % period) % period;
  complete_ = false;
  reason_ = StopReason::none;
  last_trouble_ = Outcome::ok;
  jitter_left_ns2_ = jitter_ns2_ * static_cast<double>(excitation_.samples);
  phase_ = Phase::leading;
  lead();
}

/// Sets the gain of the next sample, which is measured unless samples before the run are left.
void MeasurementLoop::lead() noexcept {
  gain_ = quiet_left_ > 0
              ? 0.0
              : 1.0 - static_cast<double>(ramp_left_) / static_cast<double>(ramp_samples_ + 1);
  if (quiet_left_ + ramp_left_ > 0) return;
  phase_ = Phase::measuring;
  health_ = {};
  timing_ = {};
}

LoopStatus MeasurementLoop::step() noexcept {
  if (phase_ == Phase::idle) return LoopStatus::ended;
  double* row = recording() ? ring_.reserve() : landing_row_.data();
  if (row == nullptr) [[unlikely]]
    return LoopStatus::ring_full;

  compute_command();
  const SampleStatus status = status_;
  const SampleStamp stamp = stamp_;
  const std::int64_t sent_ns = inputs_.t_sample_ns;
  const bool odd_command = write_row(row);
  const Deadline deadline{wall_clock_ ? inputs_.t_sample_ns + 2 * period_ns_ : 0};
  std::int64_t computed_ns = 0;
  if (wall_clock_) [[unlikely]]
    computed_ns = monotonic_ns();
  inputs_.t_ready_ns = inputs_.t_arrival_ns = inputs_.stamp_ns = 0;
  const Outcome outcome = stage_.exchange({cycle_, u_}, inputs_, deadline);
  if (wall_clock_) [[unlikely]]
    time_cycle(computed_ns, outcome);
  if (inputs_.node_state != node_state_) [[unlikely]]
    tell_state();

  if (!inputs_.applied.empty()) [[unlikely]]
    std::copy(inputs_.applied.begin(), inputs_.applied.end(), row);
  if (recording()) {
    // If u[n] may not have been applied as recorded, this sample is marked too.
    SampleStatus stored = status;
    stored.marked |= odd_command || !gives_measurement(outcome) || phase_ != Phase::measuring;
    if (stamps_) row[ring_.row_words() - 2] = std::bit_cast<double>(pack_stamp(stamp));
    row[ring_.row_words() - 1] = std::bit_cast<double>(pack_status(stored));
    ring_.commit();
    ++health_.cycles;
    health_.marked += stored.marked ? 1U : 0U;
  }
  take_measurement(outcome);
  if (wall_clock_) [[unlikely]]
    judge_instant(sent_ns);
  return advance();
}

/// The instant of y[n+1] is that of the setpoint u[n] plus a constant, or n periods by the clock of the stage.
void MeasurementLoop::judge_instant(std::int64_t sent_ns) noexcept {
  stamp_ = {};
  if (inputs_.t_arrival_ns != 0)
    stamp_.arrival_ns = static_cast<std::uint32_t>(std::clamp<std::int64_t>(
        inputs_.t_arrival_ns - sent_ns, 1, std::numeric_limits<std::uint32_t>::max()));
  if (inputs_.stamp_ns == 0) return;
  if (inputs_.stamp_of_stage) stamp_.node_us = static_cast<std::uint16_t>(inputs_.stamp_ns / 1000);
  if (jitter_ns_ == 0) return;
  const std::int64_t expected_ns =
      sets_pace_ ? static_cast<std::int64_t>(cycle_) * period_ns_ : sent_ns;
  if (regular(clock_.take(expected_ns, inputs_.stamp_ns))) return;
  status_.irregular = status_.marked = true;
  health_.irregular += recording() ? 1U : 0U;
}

bool MeasurementLoop::regular(std::int64_t deviation_ns) noexcept {
  if (std::abs(deviation_ns) > jitter_ns_) return false;
  if (jitter_ns2_ == 0.0 || !recording()) return true;
  const double square = static_cast<double>(deviation_ns) * static_cast<double>(deviation_ns);
  if (square > jitter_ns2_ && square > jitter_left_ns2_) return false;
  jitter_left_ns2_ -= square;
  return true;
}

/// If the stage does not report when its wait began, the whole exchange counts as waiting.
void MeasurementLoop::time_cycle(std::int64_t computed_ns, Outcome outcome) noexcept {
  const std::int64_t ready_ns = std::max(computed_ns, inputs_.t_ready_ns);
  if (recording()) {
    const std::int64_t lateness_ns = inputs_.t_rx_ns - inputs_.t_sample_ns;
    timing_.execution.add(ready_ns - awake_ns_);
    timing_.lateness.add(lateness_ns);
    if (outcome == Outcome::late && lateness_ns > 0)
      timing_.skipped += static_cast<std::uint64_t>(lateness_ns / period_ns_);
  }
  awake_ns_ = monotonic_ns();
}

void MeasurementLoop::tell_state() noexcept {
  node_state_ = inputs_.node_state;
  tell(LoopEvent::Kind::state, static_cast<std::uint8_t>(node_state_));
}

void MeasurementLoop::tell(LoopEvent::Kind kind, std::uint8_t code) noexcept {
  events_.push({run_, sample_, kind, code});
}

void MeasurementLoop::compute_command() noexcept {
  controller_.update(y_.data(), u_.data());
  if (quiet_left_ > 0 || phase_ == Phase::holding) [[unlikely]]
    return;
  const std::vector<std::size_t>& excited = excitation_.actuators;
  const double* r = excitation_.rows.data() + phase_sample_ * excited.size();
  for (std::size_t k = 0; k < excited.size(); ++k) u_[excited[k]] += gain_ * r[k];
  if (++phase_sample_ == excitation_.period_samples) phase_sample_ = 0;
}

/// Writes u[n] and y[n]. A command that is not finite is passed to the stage, which refuses it, but the log must
/// contain finite numbers only. @returns true for such a command
bool MeasurementLoop::write_row(double* row) noexcept {
  const bool finite = all_finite(u_);
  if (finite) [[likely]] {
    std::copy(u_.begin(), u_.end(), last_finite_u_.begin());
  }
  std::copy(last_finite_u_.begin(), last_finite_u_.end(), row);
  std::copy(y_.begin(), y_.end(), row + u_.size());
  return !finite;
}

void MeasurementLoop::take_measurement(Outcome outcome) noexcept {
  const std::int64_t lateness = std::clamp<std::int64_t>(inputs_.t_rx_ns - inputs_.t_sample_ns, 0,
                                                         std::numeric_limits<std::uint32_t>::max());
  health_.largest_lateness_ns = std::max(health_.largest_lateness_ns, lateness);
  status_ = {static_cast<std::uint8_t>(outcome), outcome != Outcome::ok,
             static_cast<std::uint32_t>(lateness)};
  if (gives_measurement(outcome) && all_finite(fresh_)) [[likely]] {
    std::copy(fresh_.begin(), fresh_.end(), y_.begin());
    if (outcome == Outcome::ok) [[likely]] {
      bucket_ = std::max(0, bucket_ - 1);
      return;
    }
    health_.late += recording() && outcome == Outcome::late ? 1U : 0U;
    count_bad_cycle(outcome);
    return;
  }
  status_.marked = true;
  if (outcome == Outcome::limit || outcome == Outcome::braking || outcome == Outcome::opened) {
    hold_missing(inputs_.valid);
    last_trouble_ = outcome;
    request_stop(StopReason::limit);
    if (outcome == Outcome::braking) ramp_left_ = std::max<std::uint64_t>(ramp_left_, 1);
    if (outcome == Outcome::opened) end(StopReason::limit);
    return;
  }
  hold_missing(gives_measurement(outcome)       ? ~std::uint64_t{0}
               : outcome == Outcome::incomplete ? inputs_.valid
                                                : 0);
  health_.missing += recording() ? 1U : 0U;
  if (ends_run(outcome)) {
    last_trouble_ = outcome;
    // A replay ends with link_down in the unrecorded ramp of a good run; this is not a fault.
    if (phase_ == Phase::landing && reason_ == StopReason::none && !hold_ &&
        outcome != Outcome::link_down) {
      reason_ = StopReason::fault;
      tell(LoopEvent::Kind::stop, static_cast<std::uint8_t>(reason_));
    }
    end(StopReason::fault);
    return;
  }
  count_bad_cycle(outcome);
}

void MeasurementLoop::hold_missing(std::uint64_t valid) noexcept {
  for (std::size_t i = 0; i < y_.size(); ++i) {
    if (((valid >> i) & 1U) != 0 && std::isfinite(fresh_[i])) y_[i] = fresh_[i];
  }
}

void MeasurementLoop::count_bad_cycle(Outcome outcome) noexcept {
  last_trouble_ = outcome;
  bucket_ += kBadCycle;
  if (bucket_ <= misses_allowed_) return;
  if (phase_ != Phase::stopping && phase_ != Phase::landing) {
    request_stop(StopReason::misses);
  } else {
    end(StopReason::misses);  // the stage does not answer during the ramp either
  }
}

void MeasurementLoop::request_stop(StopReason reason) noexcept {
  const bool over = phase_ == Phase::landing && reason_ == StopReason::none;
  if (over && !hold_ && reason == StopReason::limit) reason_ = reason;
  const bool unrecorded = phase_ == Phase::leading || phase_ == Phase::holding || (over && hold_);
  if (phase_ != Phase::measuring && !unrecorded) return;
  reason_ = reason;
  tell(LoopEvent::Kind::stop, static_cast<std::uint8_t>(reason));
  bucket_ = 0;  // new budget for the ramp
  ramp_left_ = static_cast<std::uint64_t>(std::llround(gain_ * static_cast<double>(ramp_samples_)));
  quiet_left_ = 0;
  phase_ = unrecorded || reason == StopReason::log ? Phase::landing : Phase::stopping;
}

void MeasurementLoop::end(StopReason reason) noexcept {
  if (reason_ == StopReason::none && (phase_ != Phase::landing || hold_) &&
      reason != StopReason::none) {
    reason_ = reason;
    tell(LoopEvent::Kind::stop, static_cast<std::uint8_t>(reason));
  }
  stage_.stop();
  phase_ = Phase::idle;
}

LoopStatus MeasurementLoop::advance() noexcept {
  ++cycle_;
  if (phase_ == Phase::measuring) [[likely]] {
    if (++sample_ < excitation_.samples) [[likely]]
      return LoopStatus::running;
    phase_ = Phase::landing;
    complete_ = true;
    bucket_ = 0;
    ramp_left_ = ramp_samples_;
  } else if (phase_ == Phase::idle) {
    return LoopStatus::ended;
  } else if (phase_ == Phase::holding) {
    return LoopStatus::held;
  } else if (phase_ == Phase::leading) {
    --(quiet_left_ > 0 ? quiet_left_ : ramp_left_);
    lead();
    return LoopStatus::running;
  } else {
    ++sample_;
  }
  if (ramp_left_ == 0) {
    if (hold_ && reason_ == StopReason::none) {
      phase_ = Phase::holding;
      gain_ = 0.0;
      return LoopStatus::held;
    }
    end(reason_);
    return LoopStatus::ended;
  }
  gain_ = static_cast<double>(ramp_left_) / static_cast<double>(ramp_samples_ + 1);
  --ramp_left_;
  return LoopStatus::running;
}

}  // namespace stageid
