#pragma once

#include <complex>
#include <numbers>
#include <vector>

#include "estimation/model/poles.hpp"
#include "estimation/search/structured_fit.hpp"
#include "tests/support/models/model_fit_problem.hpp"

// Plants of any submodels, two inputs and two outputs, 400 lines from 5 to 999 Hz.

namespace stageid::test {

using Poles = std::vector<std::complex<double>>;

inline constexpr double kMiddleRad = 2.0 * std::numbers::pi * 200.0;

inline Poles joined(const Poles& a, const Poles& b) {
  Poles out = a;
  out.insert(out.end(), b.begin(), b.end());
  return out;
}

inline std::complex<double> real_pole(double frequency_hz) {
  return -2.0 * std::numbers::pi * frequency_hz;
}

struct Part {  ///< its poles, and the degree of its numerator
  int integrators;
  Poles poles;
  int degree;
};

/// Numerators at random, all powers of s of like weight in the middle of the band.
DenseProblem measured(const std::vector<Part>& parts, HoldModel hold, double delay_s);

/// Every pole moved by 2 % and a third less damped, numerators zero.
AdditiveModel start_of(const std::vector<Part>& parts, const DenseProblem& problem);

/// With circular noise of the given part of the mean magnitude, and its variance.
FrfEstimate noisy(const DenseProblem& problem, double part, std::uint64_t seed);

/// A fit of these submodels, without a rigid body, and of these modes only.
FitResult fit_submodels(const FrfEstimate& frf, std::vector<SubmodelRequest> submodels,
                        const FitOptions& options = {}, std::vector<ModeCandidate> modes = {});

}  // namespace stageid::test
