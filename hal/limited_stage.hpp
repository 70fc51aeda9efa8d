#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "hal/limits.hpp"
#include "hal/stage.hpp"

namespace stageid {

/// Puts StageLimits between the loop and any back end.
///
/// A command that would break a limit never reaches the back end: it is replaced by the nearest one
/// inside the limits (clamped, slew-limited; NaN by the last good one), exchange() says
/// Outcome::limit from then on until stop(), and violation() says which limit, where, when. The
/// loop then ramps its excitation down under control and stops; its samples are marked. A position
/// past its window, or a non-finite measurement, is reported the same way; of the latter the last
/// finite value is given instead, with its valid bit cleared, so that the controller that brings
/// the stage to rest stays sound.
///
/// The thermal limit is on sqrt(m), m[n] = a m[n-1] + (1 - a) u[n]^2, a = exp(-T / time constant),
/// from m = 0 at start(). Where a slew limit and a limit on |u| contradict each other, |u| wins.
/// A sensor that gives bit for bit the same value for longer than stuck_sensor_s is reported likewise:
/// a live one has noise. Samples in which it gives nothing do not count.
/// Worse news of the back end (fault, bus off, link down) is passed on in place of Outcome::limit.
class LimitedStage final : public CyclicStage {
 public:
  /// @throws std::invalid_argument if a limit vector has the wrong size or an entry is not
  /// positive.
  LimitedStage(std::unique_ptr<CyclicStage> stage, StageLimits limits);

  const StageInfo& info() const noexcept override { return stage_->info(); }
  /// @throws StageError also if the stage stands outside its position window or measures no number.
  void start(std::uint64_t run_seed, Inputs& first) override;
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override;
  void stop() noexcept override;
  std::string trouble() const override { return stage_->trouble(); }

  const LimitViolation& violation() const noexcept { return violation_; }
  const CyclicStage& inner() const noexcept { return *stage_; }

 private:
  void guard(const Outputs& outputs) noexcept;
  void limit_command(std::uint64_t cycle) noexcept;
  double limit_channel(Eigen::Index channel, double wanted, std::uint64_t cycle) noexcept;
  void inspect(Inputs& inputs) noexcept;
  void count_repeats(const Inputs& inputs) noexcept;
  void report(const LimitViolation& violation) noexcept;

  std::unique_ptr<CyclicStage> stage_;
  StageLimits limits_;
  LimitViolation violation_;
  bool limited_ = false;
  double decay_ = 1.0;  // a, of one sample
  // Limits per sample, infinite where there is none.
  Eigen::ArrayXd largest_n_;
  Eigen::ArrayXd step_n_;
  Eigen::ArrayXd mean_square_limit_n2_;
  Eigen::ArrayXd window_m_;
  Eigen::ArrayXd wanted_;
  Eigen::ArrayXd applied_;
  Eigen::ArrayXd mean_square_;
  Eigen::ArrayXd last_y_;
  std::uint32_t repeats_allowed_ = 0;  // of a sensor's value; 0: any number
  Eigen::Array<std::uint32_t, Eigen::Dynamic, 1> repeats_;
};

/// One line for people: "actuator z3: |u| would be 12.4 N, limit 10 N (cycle 40123)".
std::string describe(const LimitViolation& violation, const StageInfo& info);

}  // namespace stageid
