#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "hal/stage/limit_guard.hpp"
#include "hal/stage/limits.hpp"
#include "hal/stage/motion_controller.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

/// Result of opening the loop. Kind `none` of the cause: the loop was not opened.
struct Emergency {
  LimitViolation cause;
  bool braked = false;
  double response = 1.0;   ///< of the stage, relative to the expected one; 1 if a sensor failed
  double speed_m_s = 0.0;  ///< largest speed of all sensors when the forces were cut
};

/// Enforces StageLimits between the loop and any back end.
///
/// A command outside the limits is replaced by the nearest one inside (clamped, slew-limited; NaN by the
/// last good one). From then on until stop(), exchange() returns Outcome::limit, and violation() contains limit,
/// channel and cycle. A position outside its window is reported the same way. The loop then ramps its
/// excitation down in closed loop and stops; its samples are marked.
///
/// This requires a sound loop. As soon as LimitGuard finds it unsound, commands are ignored. The stage is
/// braked (Outcome::braking) if its motion is known. Then the forces are zero, exchange() returns
/// Outcome::opened, and the loop stops the stage at once. emergency() contains cause and result.
/// Inputs::applied contains the applied forces if they differ from the command.
///
/// The thermal limit is on sqrt(m), m[n] = a m[n-1] + (1 - a) u[n]^2, a = exp(-T / time constant),
/// from m = 0 at start(). If a slew limit conflicts with a limit on |u|, the latter has priority.
/// More serious outcomes of the back end (fault, bus off, link down) replace these outcomes.
class LimitedStage final : public CyclicStage {
 public:
  /// @throws std::invalid_argument without a stage or its sample rate, and from complete_limits()
  LimitedStage(std::unique_ptr<CyclicStage> stage, const StageLimits& limits);

  /// The feed-forward of the controller is not expected to move the stage, see LimitGuard::carry().
  void carry(const MotionControllerSpec& controller);

  const StageInfo& info() const noexcept override { return stage_->info(); }
  /// @throws StageError also if the stage is outside its position window or a measurement is not finite.
  void start(std::uint64_t run_seed, Inputs& first) override;
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override;
  void stop() noexcept override;
  std::string trouble() const override { return stage_->trouble(); }

  const LimitViolation& violation() const noexcept { return violation_; }
  const Emergency& emergency() const noexcept { return emergency_; }
  const CyclicStage& inner() const noexcept { return *stage_; }

 private:
  enum class Loop : std::uint8_t { closed, braking, open };

  void apply(std::uint64_t cycle) noexcept;
  double limit_channel(Eigen::Index channel, double wanted, std::uint64_t cycle) noexcept;
  void inspect(Inputs& inputs) noexcept;
  void take_emergency(const LimitViolation& cause) noexcept;
  void report(const LimitViolation& violation) noexcept;
  void report_command(const LimitViolation& violation) noexcept;

  std::unique_ptr<CyclicStage> stage_;
  LimitGuard guard_;
  LimitViolation violation_;
  Emergency emergency_;
  bool limited_ = false;
  Loop loop_ = Loop::closed;
  double decay_ = 1.0;  // a, per sample
  // Limits per sample, infinite if unlimited.
  Eigen::ArrayXd step_n_;
  Eigen::ArrayXd mean_square_limit_n2_;
  Eigen::ArrayXd wanted_;
  Eigen::ArrayXd applied_;
  Eigen::ArrayXd mean_square_;
};

/// One line for the user: "actuator z3: |u| would be 12.4 N, limit 10 N (cycle 40123)".
std::string describe(const LimitViolation& violation, const StageInfo& info);
/// The same for a whole stop: the first limit and, if the loop was opened, its cause and result.
std::string describe_stop(const LimitedStage& stage);

}  // namespace stageid
