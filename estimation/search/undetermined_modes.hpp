#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Relative standard deviations of a natural frequency and of a damping ratio above which a mode is undetermined.
inline constexpr double kOpenFrequency = 0.5;
inline constexpr double kOpenDamping = 1.0;
/// A mode of this damping ratio or more has no peak of its own.
inline constexpr double kBroad = 0.1;

/// The searched modes between the lines that the data do not determine: at a bound, or with large relative standard
/// deviations. A mode outside the lines represents everything that the plant has there and is not included.
std::vector<std::size_t> undetermined_modes(const FitResult& fit);

/// Adds a finding with their names, if there are any. A fit with a requested number of modes keeps them, and so does
/// one that is better with them. A converged fit becomes FitStatus::undetermined.
/// @param number_asked the modes were not selected by their worth: those not worth their parameters (price_of_mode())
/// are also named, and those outside the lines by less than half their half-power width
void judge_undetermined_modes(const FrfEstimate& frf, bool number_asked, FitResult& fit);

/// The same for pairs of modes that a single one could replace: a surplus mode may split a real one. At most four
/// pairs are tried, one fit each.
void judge_close_modes(const FrfEstimate& frf, const FitOptions& options, FitResult& fit);

}  // namespace stageid
