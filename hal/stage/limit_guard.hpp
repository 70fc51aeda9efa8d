#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>

#include "hal/stage/limits.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// Judges after every measurement whether the loop may remain closed. If not, brakes the stage.
///
/// For each sensor an observer predicts position p, speed v and unexplained acceleration d from the
/// forces that were applied,
///   p += T v + T^2 (B u + d) / 2,   v += T (B u + d),   e = y - p,
/// and corrects them by e with three poles at a third of the loop's bandwidth. The loop is unsound if
///   - a sensor is not finite, repeats one value for too long, or deviates from the prediction by more than
///     deviation_m within one sample (it is not used from then on);
///   - redundant sensors contradict each other by more than deviation_m: one of them drifts;
///   - |e| grows beyond deviation_m: the stage does not respond to the forces as expected;
///   - the speed exceeds its limit, or there is too much energy in the motion: the stopping point
///     y + v |v| / (2 a) under half of all forces is beyond the middle between window and hard window;
///   - |y| exceeds the hard window.
/// Without a model (StageLimits::motion empty), the predictions ignore the forces, and only the given limits
/// apply.
///
/// The brake applies  u = -M (w_b v + d) / g  for at most five time constants of the loop. If a sensor failed,
/// v is predicted from the forces and g = 1. Otherwise g is the response of the stage relative to the
/// expected one that explains the recent e best. By linearity the errors for a response g are
/// e + (g - 1) e_f, with e_f the errors of an observer that receives the forces only.
///
/// Only the constructor allocates.
class LimitGuard {
 public:
  struct Finding {
    LimitViolation violation;  ///< kind none: no violation
    bool sound = true;         ///< the loop may continue, at least for a ramp
    /// Keeps the first violation of the most serious kind. Beyond a hard window, not even a brake may act.
    void add(const LimitViolation& found, bool still_sound) noexcept {
      const bool hard = found.kind == LimitKind::hard_position;
      if (violation.kind == LimitKind::none || (sound && !still_sound) ||
          (hard && violation.kind != LimitKind::hard_position))
        violation = found;
      sound &= still_sound;
    }
  };

  /// @throws std::invalid_argument from complete_limits()
  LimitGuard(const StageLimits& limits, const StageInfo& info);

  /// A constant load, e.g. the weight, that the commands take over in their first `ramp_samples`: this part of them
  /// does not accelerate the stage, and a brake continues it. @throws std::invalid_argument for a wrong size
  void carry(const Eigen::VectorXd& load, std::uint64_t ramp_samples);
  /// Starts at rest at y.
  void start(const Inputs& first) noexcept;
  /// Takes the forces of the interval that begins now.
  void predict(const Eigen::ArrayXd& u) noexcept;
  /// Judges the measurement. A value that is not finite is replaced by the last finite one, and its valid bit
  /// is cleared.
  Finding inspect(Inputs& inputs) noexcept;

  /// @returns false if the stage cannot be braked.
  bool begin_brake() noexcept;
  bool braking() const noexcept { return brake_samples_left_ > 0; }
  /// Forces for the next interval of a brake.
  void brake(Eigen::ArrayXd& u) noexcept;

  /// As completed by complete_limits().
  const StageLimits& limits() const noexcept { return limits_; }

  /// Number of samples within which a sound loop's commands return to their limits.
  std::uint64_t settling_samples() const noexcept { return brake_samples_; }

  /// Largest speed over the sensors, m/s.
  double speed_m_s() const noexcept;
  /// Response of the stage relative to the expected one, as used by the brake.
  double response() const noexcept { return force_scale_; }

 private:
  struct Gains {
    double position = 0.0;
    double speed_hz = 0.0;
    double acceleration_hz2 = 0.0;
  };
  static Gains observer_gains(double pole_rad_s, double rate_hz) noexcept;

  void find_acceleration(const Eigen::ArrayXd& u) noexcept;
  void judge_motion(Eigen::Index sensor, double y, std::uint64_t cycle, Finding& finding) noexcept;
  void judge_place(Eigen::Index sensor, double y, std::uint64_t cycle, Finding& finding) noexcept;
  void compare_sensors(const Inputs& inputs, Finding& finding) noexcept;
  LimitViolation sensor_failure(Eigen::Index sensor, LimitKind kind, double value, double limit,
                                std::uint64_t cycle) noexcept;
  static LimitViolation violation(LimitKind kind, Eigen::Index sensor, double value, double limit,
                                  std::uint64_t cycle) noexcept {
    return {kind, static_cast<int>(sensor), value, limit, cycle, true};
  }
  double carried_share() const noexcept {
    return static_cast<double>(carried_samples_) / static_cast<double>(load_samples_);
  }
  void choose_brake_rate() noexcept;
  void correct(Eigen::Index sensor, double error) noexcept;
  double speed(Eigen::Index sensor) const noexcept {
    return open_ ? v_[sensor] : v_[sensor] + (response_ - 1.0) * force_v_[sensor];
  }

  StageLimits limits_;  // of every channel
  double period_s_ = 0.0;
  Gains gains_;
  Gains brake_gains_;
  double forget_ = 0.0;
  double brake_rate_rad_s_ = 0.0;
  std::uint64_t brake_samples_ = std::numeric_limits<std::uint64_t>::max();
  std::uint32_t repeats_allowed_ = 0;  // of a sensor's value; 0: unlimited
  Eigen::ArrayXd weight_m2_;           // of an error in the response
  Eigen::ArrayXd stopping_s2_m_;       // 1 / (2 a) with the available forces; 0: unknown
  Eigen::ArrayXd room_m_;              // within which the stage must be able to stop
  double late_fraction_ = 0.0;         // part of a sample in which the older of two commands acts

  // sensors x samples of delay: ring of the accelerations by pending commands.
  Eigen::ArrayXXd accelerations_;
  Eigen::Index newest_ = 0;
  Eigen::VectorXd acting_;
  Eigen::VectorXd force_;
  Eigen::VectorXd load_;  // empty: none
  std::uint64_t load_samples_ = 1;
  std::uint64_t carried_samples_ = 0;
  Eigen::VectorXd wanted_acceleration_;
  Eigen::VectorXd measured_;
  Eigen::VectorXd contradicting_;
  Eigen::VectorXd contradicting_at_start_;
  Eigen::ArrayXd p_, v_, d_;
  Eigen::ArrayXd force_p_, force_v_, force_d_;  // of the observer that receives the forces only
  Eigen::ArrayXd last_error_m_;
  Eigen::ArrayXd last_y_;
  Eigen::Array<std::uint32_t, Eigen::Dynamic, 1> repeats_;
  Eigen::Array<bool, Eigen::Dynamic, 1> believed_;
  Eigen::Array<bool, Eigen::Dynamic, 1> moves_;  // not a sensor of acceleration
  bool sensor_failed_ = false;
  bool open_ = false;            // whether the loop is open; the brake's observer has faster poles
  double error_by_force_ = 0.0;  // mean of e e_f and e_f^2, relative to deviation_m^2
  double force_by_force_ = 0.0;
  double response_ = 1.0;     // estimated from the errors
  double force_scale_ = 1.0;  // as used by the brake
  double brake_divisor_ = 1.0;
  std::uint64_t brake_samples_left_ = 0;
};

}  // namespace stageid
