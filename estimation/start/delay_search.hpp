#pragma once

#include "estimation/problem/fit_problem.hpp"

namespace stageid {

/// Sets all input delays to the one of least cost on a grid, with numerators solved for every candidate.
void search_delay(const FitProblem& problem, FitParameters& beta);

}  // namespace stageid
