#pragma once

#include <cstdint>

#include "tests/support/stages/varied_plant.hpp"

namespace stageid::test {

/// A plant with many modes, as large finite-element models have them (in the manner of the SLICOT examples):
/// - a building: the shear modes of a chain of 20 to 40 equal floors, exact, with Rayleigh damping;
/// - an optical drive: 30 to 60 modes over three decades of frequency, gains over six decades, 2 x 2;
/// - a satellite: 30 to 100 modes, damping ratio 0.005, clustered in groups, 3 x 3.
/// Continuous, without hold and delay. Every third has no noise; the others have 1e-4 to 1e-2 of the magnitude of each
/// line. Half of them have equally spaced lines, the others logarithmic ones.
VariedPlant draw_dense_plant(std::uint64_t seed);

}  // namespace stageid::test
