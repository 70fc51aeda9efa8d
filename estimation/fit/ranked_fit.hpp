#pragma once

#include <string>

#include "estimation/fit/fit_verdict.hpp"

namespace stageid {

/// The last fit of a search, with the ranks of the residues in FitOptions. The free residues are fitted first and
/// their ranks tested, see residue_rank_tests().
///
/// With rank one, a mode whose residue has rank two is split into two modes at the same or nearly the same frequency.
/// If the number of modes is requested, they replace the mode that is worth least. Two modes that do not converge
/// become two at the same frequency, if that costs less than their frequencies are worth (BIC), and are separated
/// again if the data require it. The cost of an insufficient rank is evidence.
/// Without a rank: settled_fit().
/// @param evidence its number of modes is used
FitResult ranked_fit(const FrfEstimate& frf, const AdditiveModel& start, const FitOptions& options,
                     FitEvidence& evidence);

/// The cost of constraining the free residues, and whether noise alone explains it.
/// @param cost_to_squares sum W |E|^2 over the cost  @param likelihood the weights are inverse variances
std::string rank_decision(double free_cost, double cost, double cost_to_squares,
                          Eigen::Index given_up, bool likelihood);

}  // namespace stageid
