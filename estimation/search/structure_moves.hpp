#pragma once

#include <string>
#include <vector>

#include "estimation/model/model_structure.hpp"
#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// A model with one part changed, to be fitted with these options.
struct StructureMove {
  std::string flag;  ///< of `stageid fit`, that requests it; else what it does
  AdditiveModel model;
  FitOptions options;
};

/// One part more, of those that are open: numerators B_0 + B_1 s, a direct term, a rigid body, a rigid body on springs
/// instead of a free one or of the modes below the lines, a delay, delays per channel.
/// @param options of the fit of `model`
std::vector<StructureMove> richer_structures(const FrfEstimate& frf, const FitOptions& options,
                                             const AdditiveModel& model, const OpenStructure& open);

/// Numerators B_0 instead of B_0 + B_1 s.
StructureMove proportional_damping(const FitOptions& options, const AdditiveModel& model);

/// One part less, of those that are open: numerators B_0, one delay, no direct term, no rigid body.
std::vector<StructureMove> simpler_structures(const FitOptions& options, const AdditiveModel& model,
                                              const OpenStructure& open);

/// Both.
std::vector<StructureMove> structure_moves(const FrfEstimate& frf, const FitOptions& options,
                                           const AdditiveModel& model, const OpenStructure& open);

/// One of two overlapping modes instead of both, the broader of which merges only into its nearest neighbour. On a
/// single resonance, two nearly equal modes with large opposite residues fit as well as one, and neither can be dropped
/// alone.
std::vector<StructureMove> merges(const FitOptions& options, const AdditiveModel& model);

}  // namespace stageid
