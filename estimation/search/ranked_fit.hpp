#pragma once

#include <string>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Who says how many modes a model has.
enum class ModeNumber : std::uint8_t {
  chosen,  ///< a search, which may go on
  asked,   ///< the request, that many
  given    ///< the request, one by one
};

/// The last fit of a search, with the ranks that FitOptions gives to residues. The free residues are fitted first,
/// and their ranks tested, see residue_rank_tests().
///
/// With rank one a mode whose residue is of rank two is two modes (at one place, or nearly). Where the number of modes
/// is chosen it becomes two; where it is asked for, in the place of the mode that is worth least. Two modes that do
/// not come to rest become two at one place if that costs no more than their places are worth (BIC), and are taken
/// apart again where the data show that they are apart. What a rank that does not suffice costs is a finding.
/// Without a rank: fit_additive_model(), or settled_fit() where the number is chosen.
FitResult ranked_fit(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options,
                     ModeNumber number);

/// What giving up the free residues cost, and whether noise alone would have.
/// @param cost_to_squares sum W |E|^2 over the cost  @param likelihood the weights are inverse variances
std::string rank_decision(double free_cost, double cost, double cost_to_squares,
                          Eigen::Index given_up, bool likelihood);

}  // namespace stageid
