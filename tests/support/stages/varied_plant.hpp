#pragma once

#include <cstdint>
#include <string>

#include "estimation/model/additive_model.hpp"
#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid::test {

/// A plant whose structure is unknown to a fit: 1 x 1 to 7 x 17; without a rigid body, free or suspended; proportional
/// or general damping; a direct term or modes beside the lines; one mode of rank two; one delay or one per channel.
struct VariedPlant {
  AdditiveModel truth;  ///< hold exact; modes with B_0, or B_0 + B_1 s
  DelayModel delay = DelayModel::estimate;
  double noise_db = 0.0;  ///< standard deviation over the median magnitude, channel by channel
  FrfEstimate frf;        ///< with noise and its estimated variance
  std::string description() const;
  /// Modes of rank one above the lowest line: a residue of rank two is two of them, a suspension none.
  int modes() const;
};

VariedPlant draw_varied_plant(std::uint64_t seed);

}  // namespace stageid::test
