#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimation/tracking/tracked_parameters.hpp"
#include "excitation/words/words.hpp"

namespace stageid {

/// What changed. `parameter` is one of tracked_parameters().
enum class ChangeKind : std::uint8_t {
  parameter,
  all_frequencies,  ///< of all tracked modes by the same factor: temperature, mass
  all_gains,        ///< of all sensors, or of all actuators, by the same factor
  noise,            ///< of a sensor
  motion,           ///< the stage moves in another way than while it was learned; it is as before
  disturbance       ///< has passed; the stage is as before
};
template <>
inline constexpr std::array kWords<ChangeKind> = {"parameter", "all_frequencies", "all_gains",
                                                  "noise",     "motion",          "disturbance"};

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
  int periods = 0;         ///< since the one that contains the transient of the change
  double statistic = 0.0;  ///< twice the logarithm of the likelihood ratio
};

/// Whether the stage itself is another one.
constexpr bool is_of_stage(ChangeKind kind) {
  return kind != ChangeKind::motion && kind != ChangeKind::disturbance;
}

/// All changes that the data can show, those of the noise last: the parameters with a standard deviation below their
/// largest_changes(), their common changes, and the noise of every sensor. @param information q x q
std::vector<PossibleChange> possible_changes(const AdditiveModel& model,
                                             const std::vector<TrackedParameter>& parameters,
                                             const Eigen::MatrixXd& information);

/// Whether the response is linear in the change.
bool is_of_gains(const PossibleChange& change, const std::vector<TrackedParameter>& parameters);

/// "frequency of the mode at 752.68 Hz", "noise of sensor 'y1'".
std::string describe(const PossibleChange& change, const std::vector<TrackedParameter>& parameters,
                     const AdditiveModel& model);

}  // namespace stageid
