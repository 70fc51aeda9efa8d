#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "estimation/modal/period_spectra.hpp"
#include "estimation/model/additive_model.hpp"
#include "estimation/tracking/reference_quality.hpp"
#include "estimation/tracking/stage_change.hpp"
#include "estimation/tracking/tracked_parameters.hpp"

namespace stageid {

struct TrackerOptions {
  /// Periods without change from which noise and reference are learned, at least 4.
  int learning_periods = 32;
  /// Periods after which the weight of a period has fallen to 1/e.
  double memory_periods = 100.0;
  double false_alarms_per_period = 1e-6;
};

/// State after a period.
struct TrackedPeriod {
  bool learning = true;  ///< the estimates are those of the last period before learning
  std::optional<StageChange> change;
  double threshold = 0.0;  ///< of the statistics
  double largest_statistic = 0.0;
  /// The same by tracked parameter, then by sensor for its noise; zero: the data cannot show the change; empty while
  /// learning.
  Eigen::VectorXd statistics;
  Eigen::VectorXd noise_power;  ///< by sensor, relative to that learned; empty while learning
};

/// Tracks the properties of a stage around a model, period by period, and detects and names their changes.
///
/// Any input determines the residual e = Y - P(x) U on its lines. In closed loop the noise is also part of U; the
/// weights of the estimate therefore depend on the mean U of the learned periods only (instruments, docs/theory.md). The
/// tracker first learns, from some periods without change, the noise and the constant part of the residual. It tests
/// later periods for changes from there, so errors of the model and nonlinear distortions cause no alarms. After a
/// change, and for another excitation, it learns again.
class ModelTracker {
 public:
  /// @param frequency_hz of the lines   @throws std::invalid_argument if there is nothing to track, or an option is out
  /// of range
  ModelTracker(const AdditiveModel& model, const Eigen::VectorXd& frequency_hz,
               const TrackerOptions& options = {});
  ~ModelTracker();
  ModelTracker(ModelTracker&&) noexcept;
  ModelTracker& operator=(ModelTracker&&) noexcept;

  TrackedPeriod add(const PeriodSpectra& period);
  /// The next period has another excitation.
  void change_excitation();

  const std::vector<TrackedParameter>& parameters() const noexcept;
  const Eigen::VectorXd& estimate() const noexcept;
  /// Of the tracked changes, without the error of the model itself, which is constant.
  Eigen::MatrixXd covariance() const;
  /// Response of the model with the tracked changes, (n_y n_u) x N, column k = vec(P_k).
  Eigen::MatrixXcd response() const;
  /// E|error|^2 of its entries, of the tracked changes as covariance().
  Eigen::MatrixXd response_variance() const;
  /// Of the last learned reference; empty before.
  const ReferenceQuality& reference() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stageid
