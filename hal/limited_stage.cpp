#include "hal/limited_stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace stageid {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::ArrayXd limit_vector(const Eigen::VectorXd& given, std::size_t channels, const char* name) {
  const auto size = static_cast<Eigen::Index>(channels);
  if (given.size() == 0) return Eigen::ArrayXd::Constant(size, kInfinity);
  if (given.size() != size)
    throw std::invalid_argument(
        fmt::format("limits: {} has {} entries for {} channels", name, given.size(), channels));
  for (Eigen::Index i = 0; i < size; ++i)
    if (!(given[i] > 0.0))
      throw std::invalid_argument(
          fmt::format("limits: {}, entry {}: {} is not positive", name, i + 1, given[i]));
  return given.array();
}

bool worse_than_limit(Outcome outcome) {
  return outcome == Outcome::fault || outcome == Outcome::bus_off || outcome == Outcome::link_down;
}

}  // namespace

LimitedStage::LimitedStage(std::unique_ptr<CyclicStage> stage, StageLimits limits)
    : stage_(std::move(stage)), limits_(std::move(limits)) {
  if (!stage_) throw std::invalid_argument("limits: there is no stage to put them on");
  const StageInfo& info = stage_->info();
  if (!(info.sample_rate_hz > 0.0))
    throw std::invalid_argument("limits: the stage tells no sample rate");
  const std::size_t actuators = info.actuators.size();
  largest_n_ = limit_vector(limits_.actuator_n, actuators, "actuator_n");
  step_n_ = limit_vector(limits_.slew_n_s, actuators, "slew_n_s") / info.sample_rate_hz;
  mean_square_limit_n2_ = limit_vector(limits_.thermal_rms_n, actuators, "thermal_rms_n").square();
  window_m_ = limit_vector(limits_.position_window_m, info.sensors.size(), "position_window_m");
  if (!(limits_.thermal_time_constant_s > 0.0) || !std::isfinite(limits_.thermal_time_constant_s))
    throw std::invalid_argument(
        fmt::format("limits: thermal_time_constant_s must be positive, not {}",
                    limits_.thermal_time_constant_s));
  decay_ = std::exp(-1.0 / (info.sample_rate_hz * limits_.thermal_time_constant_s));
  const double repeats = limits_.stuck_sensor_s * info.sample_rate_hz;
  if (!(repeats >= 0.0 && repeats < 1e9) || (repeats > 0.0 && repeats < 2.0))
    throw std::invalid_argument(
        fmt::format("limits: stuck_sensor_s is {} s at {} Hz; allowed: 0, or two samples and more",
                    limits_.stuck_sensor_s, info.sample_rate_hz));
  repeats_allowed_ = static_cast<std::uint32_t>(std::llround(repeats));
  wanted_.setZero(largest_n_.size());
  applied_.setZero(largest_n_.size());
  mean_square_.setZero(largest_n_.size());
  last_y_.setZero(window_m_.size());
  repeats_.setZero(window_m_.size());
}

void LimitedStage::start(std::uint64_t run_seed, Inputs& first) {
  violation_ = {};
  limited_ = false;
  applied_.setZero();
  mean_square_.setZero();
  last_y_.setConstant(std::numeric_limits<double>::quiet_NaN());  // equal to nothing
  repeats_.setZero();
  stage_->start(run_seed, first);
  inspect(first);
  if (limited_) {
    stage_->stop();
    throw StageError(describe(violation_, info()) + "; bring the stage into its window first");
  }
}

Outcome LimitedStage::exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept {
  if (outputs.u.size() != static_cast<std::size_t>(wanted_.size()) ||
      inputs.y.size() != static_cast<std::size_t>(last_y_.size())) {
    return Outcome::fault;
  }
  guard(outputs);
  Outputs limited = outputs;
  limited.u = {applied_.data(), outputs.u.size()};
  const Outcome outcome = stage_->exchange(limited, inputs, deadline);
  inspect(inputs);
  return limited_ && !worse_than_limit(outcome) ? Outcome::limit : outcome;
}

void LimitedStage::stop() noexcept {
  stage_->stop();
  limited_ = false;  // violation() keeps the reason until the next start()
}

// Nearly every command is inside all limits: one pass without branches finds that out.
void LimitedStage::guard(const Outputs& outputs) noexcept {
  const double fresh = 1.0 - decay_;
  int outside = 0;
  for (Eigen::Index i = 0; i < wanted_.size(); ++i) {
    const double u = outputs.u[static_cast<std::size_t>(i)];
    wanted_[i] = u;
    // Written so that NaN counts as outside.
    const bool inside = (std::abs(u) <= largest_n_[i]) & (std::abs(u - applied_[i]) <= step_n_[i]) &
                        (decay_ * mean_square_[i] + fresh * u * u <= mean_square_limit_n2_[i]);
    outside |= static_cast<int>(!inside);
  }
  if (outside != 0) limit_command(outputs.cycle);
  for (Eigen::Index i = 0; i < wanted_.size(); ++i) {
    applied_[i] = wanted_[i];
    mean_square_[i] = decay_ * mean_square_[i] + fresh * applied_[i] * applied_[i];
  }
}

void LimitedStage::limit_command(std::uint64_t cycle) noexcept {
  for (Eigen::Index i = 0; i < wanted_.size(); ++i)
    wanted_[i] = limit_channel(i, wanted_[i], cycle);
}

double LimitedStage::limit_channel(Eigen::Index channel, double wanted,
                                   std::uint64_t cycle) noexcept {
  const auto number = static_cast<int>(channel);
  const double last = applied_[channel];
  if (!std::isfinite(wanted)) {
    report({LimitKind::not_finite, number, wanted, 0.0, cycle});
    wanted = last;
  }
  const double largest = largest_n_[channel];
  if (std::abs(wanted) > largest) report({LimitKind::actuator, number, wanted, largest, cycle});

  const double step = step_n_[channel];
  const double rate_hz = info().sample_rate_hz;
  if (std::abs(wanted - last) > step)
    report({LimitKind::slew, number, (wanted - last) * rate_hz, step * rate_hz, cycle});

  // The largest |u| whose square still fits into the mean square.
  const double kept = decay_ * mean_square_[channel];
  const double room = (mean_square_limit_n2_[channel] - kept) / (1.0 - decay_);
  const double warm = std::sqrt(std::max(0.0, room));
  if (kept + (1.0 - decay_) * wanted * wanted > mean_square_limit_n2_[channel])
    report({LimitKind::thermal_rms, number, std::sqrt(kept + (1.0 - decay_) * wanted * wanted),
            std::sqrt(mean_square_limit_n2_[channel]), cycle});

  const double slewed = std::clamp(wanted, last - step, last + step);
  const double bound = std::min(largest, warm);
  return std::clamp(slewed, -bound, bound);
}

void LimitedStage::inspect(Inputs& inputs) noexcept {
  int outside = 0;
  for (Eigen::Index i = 0; i < window_m_.size(); ++i) {
    const double y = inputs.y[static_cast<std::size_t>(i)];
    // An infinite window holds every number but not NaN; infinity itself is caught below.
    outside |= static_cast<int>(!(std::abs(y) <= window_m_[i]) | !(std::abs(y) < kInfinity));
  }
  for (Eigen::Index i = 0; outside != 0 && i < window_m_.size(); ++i) {
    double& y = inputs.y[static_cast<std::size_t>(i)];
    if (!std::isfinite(y)) {
      report({LimitKind::not_finite, static_cast<int>(i), y, 0.0, inputs.cycle, true});
      inputs.valid &= ~(std::uint64_t{1} << i);
      y = std::isfinite(last_y_[i]) ? last_y_[i] : 0.0;
    } else if (std::abs(y) > window_m_[i]) {
      report({LimitKind::position, static_cast<int>(i), y, window_m_[i], inputs.cycle, true});
    }
  }
  if (repeats_allowed_ > 0) count_repeats(inputs);
  std::copy(inputs.y.begin(), inputs.y.end(), last_y_.begin());
}

void LimitedStage::count_repeats(const Inputs& inputs) noexcept {
  for (Eigen::Index i = 0; i < repeats_.size(); ++i) {
    if (((inputs.valid >> i) & 1U) == 0) continue;
    const double y = inputs.y[static_cast<std::size_t>(i)];
    repeats_[i] = y == last_y_[i] ? repeats_[i] + 1 : 0;
    if (repeats_[i] >= repeats_allowed_)
      report({LimitKind::stuck_sensor, static_cast<int>(i), y, limits_.stuck_sensor_s, inputs.cycle,
              true});
  }
}

void LimitedStage::report(const LimitViolation& violation) noexcept {
  if (violation_.kind == LimitKind::none) violation_ = violation;
  limited_ = true;
}

std::string describe(const LimitViolation& violation, const StageInfo& info) {
  if (violation.kind == LimitKind::none) return "no limit was hit";
  const std::vector<Channel>& channels = violation.of_sensor ? info.sensors : info.actuators;
  const auto index = static_cast<std::size_t>(violation.channel);
  std::string who = fmt::format(
      "{} {}", violation.of_sensor ? "sensor" : "actuator",
      index < channels.size() ? channels[index].name : std::to_string(violation.channel));
  const auto line = [&](const char* what, const char* unit) {
    return fmt::format("{}: {} {:.4g} {}, limit {:.4g} {} (cycle {})", who, what,
                       std::abs(violation.value), unit, violation.limit, unit, violation.cycle);
  };
  switch (violation.kind) {
    case LimitKind::none:
      break;
    case LimitKind::actuator:
      return line("|u| would be", "N");
    case LimitKind::slew:
      return line("slew would be", "N/s");
    case LimitKind::thermal_rms:
      return line("thermal rms would be", "N");
    case LimitKind::position:
      return line("|y| is", "m");
    case LimitKind::not_finite:
      return fmt::format("{}: {} is not finite (cycle {})", who,
                         violation.of_sensor ? "the measurement" : "the command", violation.cycle);
    case LimitKind::stuck_sensor:
      return fmt::format("{}: has shown {:.6g} m and nothing else for {:.4g} s (cycle {})", who,
                         violation.value, violation.limit, violation.cycle);
  }
  return who;
}

}  // namespace stageid
