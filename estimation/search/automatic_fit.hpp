#pragma once

#include <memory>
#include <vector>

#include "estimation/model/cmif.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/search/fit_additive_model.hpp"

namespace stageid {

/// What decides the number of modes.
struct ModeSelection {
  std::vector<ModeCandidate> modes;  ///< start here; empty: from the CMIF
  int exactly = 0;                   ///< > 0: so many modes; 0: by statistics (BIC)
  bool keep_modes = false;           ///< fit `modes` as they are: none added, none removed
  int most = 60;
  /// Of a search that chooses the number, in seconds of an ordinary core, see SearchLimit; 0: no end.
  double search_seconds = 180.0;
};

/// A fit that completes its own start: peaks of the CMIF, then modes at the peaks of the weighted
/// residual's CMIF while they are worth their parameters, duplicates merged, worthless ones
/// dropped; last, see settled_fit(). Every decision is in FitResult::decisions. FitOptions::progress is called with the iterations of
/// all fits on the way.
/// @throws std::invalid_argument: as fit_additive_model(), and for more modes than the lines carry
FitResult automatic_fit(const FrfEstimate& frf, const ModelStructure& structure,
                        const ModeSelection& selection, const FitOptions& options);

/// That of `options`, or a new one: with a budget where `selection` leaves the number of modes open.
std::shared_ptr<SearchLimit> search_limit(const ModeSelection& selection,
                                          const FitOptions& options);

}  // namespace stageid
