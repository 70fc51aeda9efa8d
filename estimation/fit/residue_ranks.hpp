#pragma once

#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// Tests the free residues of the modes between the lines. sum |B - B_r|^2 / variance, minimized over B_r of rank r,
/// is chi-square distributed with (n_y - r)(n_u - r) degrees of freedom if the residue has rank r (twice as many for
/// modes with B_0 and B_1). Rank r is contradicted if the sum exceeds ln(data) per degree of freedom, the penalty of
/// BIC: with ten thousand numbers, a chi-square variable of four degrees exceeds it once in ten million times. The
/// variances include the uncertainty of the poles. That this part is common to the channels is ignored, so the test is
/// slightly too mild for close modes. A residue known to better than 1e-8 of its largest entry is tested with that
/// accuracy.
/// @pre `model` has numerator_std; other modes are skipped, as are all with a single output or input
/// @param data number of independent real numbers that were fitted
std::vector<ResidueRankTest> residue_rank_tests(const AdditiveModel& model, double data);

/// One line of text for people; empty if nothing was tested.
std::string describe(const std::vector<ResidueRankTest>& tests);

}  // namespace stageid
