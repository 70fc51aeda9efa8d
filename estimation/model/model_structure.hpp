#pragma once

#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The parts of a structure that a search may change.
struct OpenStructure {
  bool rigid_body = false;
  bool direct_term = false;
  bool general_damping = false;
  bool delay = false;
  bool operator==(const OpenStructure&) const = default;
};

/// Submodels besides the modes.
struct ModelStructure {
  bool rigid_body = true;            ///< B_0 / s^2
  bool direct_term = false;          ///< a constant matrix: compliance of modes above the band
  bool general_damping = false;      ///< modes with B_0 + B_1 s (general viscous) instead of B_0
  std::vector<Submodel> given = {};  ///< further ones with start values; role not `searched`
  OpenStructure open = {};           ///< a search chooses these, starting from the values above
};

constexpr double kSuspensionStart = 0.25;  ///< of the lowest line: frequency of a suspension

/// A rigid body of up to min(n_y, n_u) degrees of freedom on springs, numerators zero.
Submodel suspension_mode(const FrfEstimate& frf, double frequency_hz);

/// The structure of a model, with nothing open.
ModelStructure structure_of(const AdditiveModel& model);

/// A mode at the frequency and damping of its candidate, numerators zero.
Submodel mode_submodel(const FrfEstimate& frf, const ModelStructure& structure,
                       const ModeCandidate& mode);

/// The submodels besides the modes, numerators zero.
std::vector<Submodel> fixed_submodels(const FrfEstimate& frf, const ModelStructure& structure);

/// The candidates farther than 5 % from every starting pole of the given submodels.
std::vector<ModeCandidate> without_given(const std::vector<ModeCandidate>& candidates,
                                         const ModelStructure& structure);

/// -1 below the lines, 1 above them, else 0.
int side_of_lines(const FrfEstimate& frf, double frequency_hz);

/// A mode that was found by a search and may be dropped again.
bool is_searched_mode(const Submodel& submodel) noexcept;

/// Number of searched modes.
int count_modes(const AdditiveModel& model);

/// Indices of the submodels if searched modes are sorted by frequency, after the others.
std::vector<std::size_t> mode_order(const AdditiveModel& model);

/// Largest number of modes that the lines support. The functions of a channel are real combinations on 2 N real
/// values; a third of these is reserved to distinguish modes from noise.
Eigen::Index most_modes(const FrfEstimate& frf, const ModelStructure& structure);

}  // namespace stageid
