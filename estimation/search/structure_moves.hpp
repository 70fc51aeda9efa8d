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
/// instead of a free one, a delay, delays per channel.
/// @param options of the fit of `model`
std::vector<StructureMove> richer_structures(const FrfEstimate& frf, const FitOptions& options,
                                             const AdditiveModel& model, const OpenStructure& open);

/// One part less, of those that are open: numerators B_0, one delay, no direct term, no rigid body.
std::vector<StructureMove> simpler_structures(const FitOptions& options, const AdditiveModel& model,
                                              const OpenStructure& open);

/// Both.
std::vector<StructureMove> structure_moves(const FrfEstimate& frf, const FitOptions& options,
                                           const AdditiveModel& model, const OpenStructure& open);

/// Some of the lines and inputs of an FRF, evenly spaced, with a model of them and the options of a fit.
struct StructureTrial {
  FrfEstimate frf;
  FitOptions options;
  AdditiveModel model;
  bool all = false;  ///< there are few: these are all
};

/// As many lines and inputs as show the structure: it acts on all, while a mode acts on few lines. All, if there are
/// few.
/// @param options with FitOptions::user_weights, which become those of the trial
StructureTrial structure_trial(const FrfEstimate& frf, const FitOptions& options,
                               const AdditiveModel& model);

/// One of two overlapping modes instead of both, the broader of which merges only into its nearest neighbour. On a
/// single resonance, two nearly equal modes with large opposite residues fit as well as one, and neither can be dropped
/// alone.
std::vector<StructureMove> merges(const FitOptions& options, const AdditiveModel& model);

/// The poles and delays of a model of a trial, for all inputs; of those that were not in it, the mean delay.
AdditiveModel with_all_inputs(const FrfEstimate& frf, AdditiveModel model);

}  // namespace stageid
