#pragma once

#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Which submodels beside the modes.
struct ModelStructure {
  bool rigid_body = true;            ///< B_0 / s^2
  bool direct_term = false;          ///< a constant matrix: compliance of modes above the band
  bool general_damping = false;      ///< modes with B_0 + B_1 s (general viscous) instead of B_0
  std::vector<Submodel> given = {};  ///< further ones at their start; their role is not `searched`
};

/// A mode at its candidate's place, numerators zero.
Submodel mode_submodel(const FrfEstimate& frf, const ModelStructure& structure,
                       const ModeCandidate& mode);

/// The submodels beside the modes, numerators zero.
std::vector<Submodel> fixed_submodels(const FrfEstimate& frf, const ModelStructure& structure);

/// Those candidates that no given submodel stands for: none of its poles starts within 5 %.
std::vector<ModeCandidate> without_given(const std::vector<ModeCandidate>& candidates,
                                         const ModelStructure& structure);

/// A mode that a search found and may drop again.
bool is_searched_mode(const Submodel& submodel) noexcept;

/// Of them.
int count_modes(const AdditiveModel& model);

/// The places of the submodels in the order of sort_modes().
std::vector<std::size_t> mode_order(const AdditiveModel& model);

/// Searched modes by frequency, behind the other submodels.
void sort_modes(AdditiveModel& model);

/// More modes than this the lines of an FRF cannot carry: a channel's functions are real combinations
/// on 2 N real values, of which a third is left to tell noise from modes.
Eigen::Index most_modes(const FrfEstimate& frf, const ModelStructure& structure);

}  // namespace stageid
