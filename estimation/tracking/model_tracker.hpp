#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "estimation/modal/period_spectra.hpp"
#include "estimation/model/additive_model.hpp"
#include "estimation/tracking/tracked_parameters.hpp"

namespace stageid {

struct TrackerOptions {
  /// Periods without change from which noise and reference are learned, at least 4.
  int learning_periods = 32;
  /// Periods after which the weight of a period has fallen to 1/e.
  double memory_periods = 100.0;
  double false_alarms_per_period = 1e-6;
};

/// What changed. `parameter` is one of tracked_parameters().
enum class ChangeKind : std::uint8_t {
  parameter,
  all_frequencies,  ///< of all tracked modes by the same factor: temperature, mass
  all_gains,        ///< of all sensors, or of all actuators, by the same factor
  noise,            ///< of a sensor
  disturbance       ///< has passed; the stage is as before
};
template <>
inline constexpr std::array kWords<ChangeKind> = {"parameter", "all_frequencies", "all_gains",
                                                  "noise", "disturbance"};

/// A hypothesis about a change.
struct PossibleChange {
  ChangeKind kind = ChangeKind::parameter;
  Eigen::Index index = 0;     ///< into tracked_parameters(), or of the sensor
  Eigen::VectorXd direction;  ///< of the tracked parameters; empty for noise
};

/// A change that was detected.
struct StageChange {
  PossibleChange what;
  double size = 0.0;         ///< as the tracked parameter; noise: relative change of the rms
  double deviation = 0.0;    ///< standard deviation of size
  double probability = 0.0;  ///< among all possible changes, equally probable before
  /// The next probable one, and its probability.
  std::optional<PossibleChange> otherwise;
  double other_probability = 0.0;
  int periods = 0;  ///< since the change
  double statistic = 0.0;
};

/// State after a period.
struct TrackedPeriod {
  bool learning = true;  ///< the estimates are those of the last period before learning
  std::optional<StageChange> change;
  double largest_statistic = 0.0;
  double threshold = 0.0;
  Eigen::VectorXd noise_power;  ///< by sensor, relative to that learned; empty while learning
};

/// How well the model explains the periods from which the reference was learned.
struct ReferenceQuality {
  /// Mean square of the constant residual, relative to noise alone: 1 for an exact model, by sensor.
  Eigen::VectorXd chi_square;
  Eigen::VectorXd
      relative_error;  ///< rms of the constant residual over that of the output, without noise
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
  /// Of the last learned reference; empty before.
  const ReferenceQuality& reference() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// "natural frequency of the mode at 752.68 Hz", "noise of sensor 'y1'".
std::string describe(const PossibleChange& change, const ModelTracker& tracker,
                     const AdditiveModel& model);

}  // namespace stageid
