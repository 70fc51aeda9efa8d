#pragma once

#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// Tests the free residues of the modes between the lines: sum |B - B_r|^2 / variance, least over B_r of rank r, is
/// chi-square distributed with (n_y - r)(n_u - r) degrees of freedom where the residue is of rank r (for modes with
/// B_0 and B_1 twice as many). Rank r is contradicted where that is above ln(data) for each of them, the price of
/// BIC: with ten thousand numbers a chi-square of four degrees passes it once in ten million times. The variances
/// hold the doubt about the poles; that it is common to the channels is left out, which makes the test a little too
/// mild where modes are close. A residue known to better than 1e-8 of its largest entry is tested as if it were
/// known so well.
/// @pre `model` has numerator_std; other modes are left out, as are all where the outputs or the inputs are one
/// @param data real numbers that were fitted, as many as are independent
std::vector<ResidueRankTest> residue_rank_tests(const AdditiveModel& model, double data);

/// For people, in one line; empty if nothing was tested.
std::string describe(const std::vector<ResidueRankTest>& tests);

}  // namespace stageid
