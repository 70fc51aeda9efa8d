#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "excitation/multisine/frequency_grid.hpp"
#include "excitation/words/words.hpp"

namespace stageid {

enum class AmplitudeScaling : std::uint8_t {
  rms,  ///< `level` is the root mean square of the samples over one period
  peak  ///< `level` is the largest absolute sample
};
template <>
inline constexpr std::array kWords<AmplitudeScaling> = {"rms", "peak"};

/// Arguments of random_phase_multisine(), which checks them.
struct MultisineSpec {
  double level = 1.0;  ///< in the unit of the excited channel, see `scaling`
  AmplitudeScaling scaling = AmplitudeScaling::rms;
  std::uint64_t seed = 0;      ///< each seed gives one realization, the same on every machine
  Eigen::VectorXd shape = {};  ///< relative amplitude per line, size of the grid; empty: flat
  int crest_iterations = 0;    ///< largest number of clipping iterations; 0: random phases
};

/// One period of a multisine on `grid`:  x(n) = sum_k A_k cos(2 pi l_k n / N + phi_k).
struct Multisine {
  FrequencyGrid grid;
  Eigen::VectorXd samples;    ///< size grid.samples_per_period(), unit of MultisineSpec::level
  Eigen::VectorXd amplitude;  ///< A_k, size grid.size()
  Eigen::VectorXd phase_rad;  ///< phi_k, size grid.size(), in [0, 2 pi)
};

/// Draws a random-phase multisine, phi_k independent and uniform on [0, 2 pi).
///
/// With `crest_iterations` > 0, the phases are then changed by clipping in the time domain (on a four times
/// oversampled period) and restoring the prescribed amplitudes. The best iterate is kept. Use this for linear
/// plants: the amplitude density is no longer Gaussian. Source: Pintelon and Schoukens, System
/// Identification (2012); Van der Ouderaa et al. (1988).
/// @throws std::invalid_argument if level is not positive and finite, or shape has the wrong size,
///         a negative or non-finite entry, or is zero everywhere.
Multisine random_phase_multisine(const FrequencyGrid& grid, const MultisineSpec& spec);

/// max |x| / rms(x) of the samples. The signal between the samples may be larger.
/// @throws std::invalid_argument if there are no samples or all are zero.
double crest_factor(const Eigen::Ref<const Eigen::VectorXd>& samples);

}  // namespace stageid
