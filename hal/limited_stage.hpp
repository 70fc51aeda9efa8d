#pragma once

#include <Eigen/Core>
#include <memory>

#include "hal/limits.hpp"
#include "hal/stage.hpp"

namespace stageid {

/// Puts StageLimits between the loop and any back end.
///
/// A command that would break a limit never reaches the back end: it is replaced by the nearest one
/// inside the limits (clamped, slew-limited; NaN by the last good one), exchange() says
/// Outcome::limit from then on until stop(), and violation() says which limit, where, when. The loop
/// then ramps its excitation down under control and stops; its samples are marked.
/// A position past its window, or a non-finite measurement, is reported the same way.
class LimitedStage final : public CyclicStage {
 public:
  /// @throws std::invalid_argument if a limit vector has the wrong size or an entry is not positive.
  LimitedStage(std::unique_ptr<CyclicStage> stage, StageLimits limits);

  const StageInfo& info() const noexcept override { return stage_->info(); }
  void start(std::uint64_t run_seed, Inputs& first) override;
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs, Deadline deadline) noexcept override;
  void stop() noexcept override;

  const LimitViolation& violation() const noexcept { return violation_; }
  CyclicStage& inner() noexcept { return *stage_; }

 private:
  void guard(const Outputs& outputs) noexcept;

  std::unique_ptr<CyclicStage> stage_;
  StageLimits limits_;
  LimitViolation violation_;
  Eigen::VectorXd applied_;
  Eigen::VectorXd mean_square_;
};

/// One line for people: "actuator z3: |u| would be 12.4 N, limit 10 N (cycle 40123)".
std::string describe(const LimitViolation& violation, const StageInfo& info);

}  // namespace stageid
