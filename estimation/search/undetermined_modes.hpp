#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Of a natural frequency, and of a damping ratio: a standard deviation as large says that the data leave it open.
inline constexpr double kOpenFrequency = 0.5;
inline constexpr double kOpenDamping = 1.0;
/// A mode of this damping ratio or more has no peak of its own.
inline constexpr double kBroad = 0.1;

/// The searched modes between the lines that the data leave open: at a bound, or with standard deviations as large as
/// that. Beside the lines a mode stands for whatever the plant does there, and is none of them.
std::vector<std::size_t> undetermined_modes(const FitResult& fit);

/// Adds a finding that names them, if there are any: a fit whose number of modes is asked for keeps them, and so does
/// one whose cost they are worth. If it converged it is FitStatus::undetermined then.
/// @param number_asked the modes were not chosen by what they are worth: those that are not worth their parameters
///        (price_of_mode()) are named too, and those beside the lines by less than half their half-power width
void judge_undetermined_modes(const FrfEstimate& frf, bool number_asked, FitResult& fit);

/// The same for pairs of modes of which one does as well: a mode too many may halve one that is there. Each of at most
/// four pairs costs a fit.
void judge_close_modes(const FrfEstimate& frf, const FitOptions& options, FitResult& fit);

}  // namespace stageid
