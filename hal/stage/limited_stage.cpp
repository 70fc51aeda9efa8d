#include "hal/stage/limited_stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

std::unique_ptr<CyclicStage> checked(std::unique_ptr<CyclicStage> stage) {
  require(stage != nullptr, "limits: a stage is required");
  require(stage->info().sample_rate_hz > 0.0,
          "limits: the stage has no sample rate; set sample_rate_hz");
  return stage;
}

}  // namespace

LimitedStage::LimitedStage(std::unique_ptr<CyclicStage> stage, const StageLimits& limits)
    : stage_(checked(std::move(stage))), guard_(limits, stage_->info()) {
  const StageLimits& all = guard_.limits();
  const double rate_hz = info().sample_rate_hz;
  decay_ = std::exp(-1.0 / (rate_hz * all.thermal_time_constant_s));
  step_n_ = all.slew_n_s / rate_hz;
  mean_square_limit_n2_ = all.thermal_rms_n.array().square();
  wanted_.setZero(step_n_.size());
  applied_.setZero(step_n_.size());
  mean_square_.setZero(step_n_.size());
}

void LimitedStage::carry(const MotionControllerSpec& controller) {
  guard_.carry(controller.feed_forward_n, MotionController(controller).feed_forward_samples());
}

void LimitedStage::start(std::uint64_t run_seed, Inputs& first) {
  violation_ = {};
  emergency_ = {};
  limited_ = false;
  loop_ = Loop::closed;
  applied_.setZero();
  mean_square_.setZero();
  stage_->start(run_seed, first);
  guard_.start(first);
  const LimitGuard::Finding finding = guard_.inspect(first);
  if (finding.violation.kind != LimitKind::none) {
    violation_ = finding.violation;
    stage_->stop();
    throw StageError(describe(violation_, info()) + "; move the stage into its window first");
  }
}

Outcome LimitedStage::exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept {
  if (outputs.u.size() != static_cast<std::size_t>(wanted_.size()) ||
      inputs.y.size() != info().sensors.size()) {
    return Outcome::fault;
  }
  if (loop_ == Loop::closed)
    std::copy(outputs.u.begin(), outputs.u.end(), wanted_.begin());
  else if (loop_ == Loop::braking)
    guard_.brake(wanted_);
  else
    wanted_.setZero();
  apply(outputs.cycle);
  guard_.predict(applied_);
  Outputs limited = outputs;
  limited.u = {applied_.data(), outputs.u.size()};
  const Outcome outcome = stage_->exchange(limited, inputs, deadline);
  inputs.applied = {};
  if (limited_) inputs.applied = limited.u;
  inspect(inputs);
  if (!limited_ || ends_run(outcome)) return outcome;
  return loop_ == Loop::closed    ? Outcome::limit
         : loop_ == Loop::braking ? Outcome::braking
                                  : Outcome::opened;
}

void LimitedStage::stop() noexcept {
  stage_->stop();
  if (loop_ != Loop::closed) emergency_.speed_m_s = guard_.speed_m_s();
  limited_ = false;  // violation() and emergency() keep their values until the next start()
  loop_ = Loop::closed;
}

// Fast path: one pass without branches, because nearly every command is within all limits.
void LimitedStage::apply(std::uint64_t cycle) noexcept {
  const Eigen::VectorXd& largest_n = guard_.limits().actuator_n;
  const double fresh = 1.0 - decay_;
  int outside = 0;  // a bool is not vectorized
  for (Eigen::Index i = 0; i < wanted_.size(); ++i) {
    const double u = wanted_[i];
    // This form counts NaN as outside.
    outside |= static_cast<int>(!(std::abs(u) <= largest_n[i]));
    outside |= static_cast<int>(!(std::abs(u - applied_[i]) <= step_n_[i]));
    outside |=
        static_cast<int>(!(decay_ * mean_square_[i] + fresh * u * u <= mean_square_limit_n2_[i]));
  }
  for (Eigen::Index i = 0; outside != 0 && i < wanted_.size(); ++i)
    wanted_[i] = limit_channel(i, wanted_[i], cycle);
  for (Eigen::Index i = 0; i < wanted_.size(); ++i) {
    applied_[i] = wanted_[i];
    mean_square_[i] = decay_ * mean_square_[i] + fresh * applied_[i] * applied_[i];
  }
}

double LimitedStage::limit_channel(Eigen::Index channel, double wanted,
                                   std::uint64_t cycle) noexcept {
  const auto number = static_cast<int>(channel);
  const double last = applied_[channel];
  if (!std::isfinite(wanted)) {
    report_command({LimitKind::not_finite, number, wanted, 0.0, cycle});
    wanted = last;
  }
  const double largest = guard_.limits().actuator_n[channel];
  if (std::abs(wanted) > largest)
    report_command({LimitKind::actuator, number, wanted, largest, cycle});

  const double step = step_n_[channel];
  const double rate_hz = info().sample_rate_hz;
  if (std::abs(wanted - last) > step)
    report_command({LimitKind::slew, number, (wanted - last) * rate_hz, step * rate_hz, cycle});

  // The largest |u| that the limit of the mean square allows.
  const double kept = decay_ * mean_square_[channel];
  const double room = (mean_square_limit_n2_[channel] - kept) / (1.0 - decay_);
  const double warm = std::sqrt(std::max(0.0, room));
  if (kept + (1.0 - decay_) * wanted * wanted > mean_square_limit_n2_[channel])
    report_command({LimitKind::thermal_rms, number,
                    std::sqrt(kept + (1.0 - decay_) * wanted * wanted),
                    std::sqrt(mean_square_limit_n2_[channel]), cycle});

  const double slewed = std::clamp(wanted, last - step, last + step);
  const double bound = std::min(largest, warm);
  return std::clamp(slewed, -bound, bound);
}

void LimitedStage::inspect(Inputs& inputs) noexcept {
  const LimitGuard::Finding finding = guard_.inspect(inputs);
  if (finding.violation.kind != LimitKind::none) [[unlikely]] {
    report(finding.violation);
    if (!finding.sound) take_emergency(finding.violation);
  }
  if (loop_ == Loop::braking && !guard_.braking()) loop_ = Loop::open;
}

void LimitedStage::take_emergency(const LimitViolation& cause) noexcept {
  // Beyond the hard window, braking has failed or cannot help.
  const bool hard = cause.kind == LimitKind::hard_position;
  if (emergency_.cause.kind == LimitKind::none) {
    emergency_.cause = cause;
    emergency_.braked = guard_.begin_brake() && !hard;
    emergency_.response = guard_.response();
    loop_ = emergency_.braked ? Loop::braking : Loop::open;
  } else if (hard) {
    loop_ = Loop::open;
  }
}

void LimitedStage::report(const LimitViolation& violation) noexcept {
  if (violation_.kind == LimitKind::none) violation_ = violation;
  limited_ = true;
}

// The commands of a stable loop return to their limits within a few of its time constants.
void LimitedStage::report_command(const LimitViolation& violation) noexcept {
  report(violation);
  if (loop_ == Loop::closed && violation.cycle - violation_.cycle > guard_.settling_samples())
    take_emergency(violation);
}

std::string describe(const LimitViolation& violation, const StageInfo& info) {
  if (violation.kind == LimitKind::none) return "no limit was exceeded";
  const std::vector<Channel>& channels = violation.of_sensor ? info.sensors : info.actuators;
  const auto index = static_cast<std::size_t>(violation.channel);
  std::string who = fmt::format(
      "{} {}", violation.of_sensor ? "sensor" : "actuator",
      index < channels.size() ? channels[index].name : std::to_string(violation.channel));
  const std::string unit = index < channels.size() ? channels[index].unit : "";
  const auto line = [&](const char* what, const char* per = "") {
    return fmt::format("{}: {} {:.4g} {}{}, limit {:.4g} {}{} (cycle {})", who, what,
                       std::abs(violation.value), unit, per, violation.limit, unit, per,
                       violation.cycle);
  };
  if (violation.kind == LimitKind::not_finite)
    return fmt::format("{}: {} is not finite (cycle {})", who,
                       violation.of_sensor ? "the measurement" : "the command", violation.cycle);
  if (violation.kind == LimitKind::stuck_sensor)
    return fmt::format("{}: has repeated the value {:.6g} {} for {:.4g} s (cycle {})", who,
                       violation.value, unit, violation.limit, violation.cycle);
  if (violation.kind == LimitKind::hard_position)
    return line("|y| is").insert(who.size() + 1, " beyond the hard window:");
  struct Row {
    LimitKind kind;
    const char* what;
    const char* per = "";
  };
  for (const Row& row :
       {Row{LimitKind::actuator, "|u| would be"}, Row{LimitKind::slew, "slew would be", "/s"},
        Row{LimitKind::thermal_rms, "thermal rms would be"}, Row{LimitKind::position, "|y| is"},
        Row{LimitKind::sensor_jump, "jumped from the predicted motion by"},
        Row{LimitKind::deviation, "deviation from the predicted motion is"},
        Row{LimitKind::contradiction, "differs from the rigid motion of all sensors by"},
        Row{LimitKind::speed, "speed is", "/s"},
        Row{LimitKind::stopping_distance, "the stopping position with half of the forces is"}})
    if (violation.kind == row.kind) return line(row.what, row.per);
  return who;
}

std::string describe_stop(const LimitedStage& stage) {
  std::string text = describe(stage.violation(), stage.info());
  const Emergency& emergency = stage.emergency();
  const LimitViolation& cause = emergency.cause;
  if (cause.kind == LimitKind::none) return text;
  const LimitViolation& first = stage.violation();
  if (cause.kind != first.kind || cause.cycle != first.cycle)
    text += "; then " + describe(cause, stage.info());
  text += "; the loop was opened";
  if (std::abs(emergency.response - 1.0) > 0.1)
    text += fmt::format(", the response was {:.2g} times the expected one", emergency.response);
  std::vector<Channel> moving = stage.info().sensors;
  std::erase_if(moving, is_acceleration);
  const std::string unit = common_unit(moving);
  return text + fmt::format("; {}, {:.2g}{} when the forces were cut",
                            emergency.braked ? "braked" : "not braked", emergency.speed_m_s,
                            unit.empty() ? "" : unit + "/s");
}

}  // namespace stageid
