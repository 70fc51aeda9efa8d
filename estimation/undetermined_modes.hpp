#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "estimation/fit_options.hpp"

namespace stageid {

/// Of a natural frequency, and of a damping ratio: a standard deviation as large says that the data leave it open.
inline constexpr double kOpenFrequency = 0.5;
inline constexpr double kOpenDamping = 1.0;

/// The searched modes between the lines that the data leave open: at a bound, or with standard deviations as large as
/// that. Beside the lines a mode stands for whatever the plant does there, and is none of them.
std::vector<std::size_t> undetermined_modes(const FitResult& fit);

/// Adds a finding that names them, if there are any: a fit whose number of modes is asked for keeps them, and so does
/// one whose cost they are worth. If it converged it is FitStatus::undetermined then.
void judge_undetermined_modes(FitResult& fit);

}  // namespace stageid
