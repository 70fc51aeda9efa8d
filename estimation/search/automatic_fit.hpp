#pragma once

#include <memory>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "estimation/model/model_structure.hpp"

namespace stageid {

struct FitEvidence;

/// How the number of modes is decided.
struct ModeSelection {
  std::vector<ModeCandidate> modes;  ///< start values; empty: from the CMIF
  int exactly = 0;                   ///< > 0: this number; 0: by statistics (BIC)
  bool keep_modes = false;           ///< fit `modes` without adding or removing any
  /// Budget of a search that chooses the number, in seconds of a typical core, see SearchLimit; 0: unlimited.
  double search_seconds = 180.0;
};

/// A fit that completes its own start. It starts with the peaks of the CMIF and adds modes at the peaks of the CMIF of
/// the weighted residual while they are worth their parameters. Duplicates are merged and modes that are not worth
/// their parameters are dropped; see settled_fit() for the last fit. Every decision is in FitResult::decisions.
/// FitOptions::progress is called for the iterations of all fits.
/// @throws std::invalid_argument: as fit_additive_model(), and for more modes than the lines support
FitResult automatic_fit(const FrfEstimate& frf, const ModelStructure& structure,
                        const ModeSelection& selection, const FitOptions& options);

/// The same before its verdict, see judge().
FitResult searched_fit(const FrfEstimate& frf, const ModelStructure& structure,
                       const ModeSelection& selection, const FitOptions& options,
                       FitEvidence& evidence);

/// The limit of `options`, or a new one: with a budget if `selection` leaves the number of modes open.
std::shared_ptr<SearchLimit> search_limit(const ModeSelection& selection,
                                          const FitOptions& options);

}  // namespace stageid
