#pragma once

#include "estimation/model/additive_model.hpp"
#include "estimation/problem/fit_options.hpp"
#include "frf/response/channel_tiles.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// `options` for fits that are compared with each other: few iterations to the same minimum, free residues, the
/// weights computed once and diagonal, no standard deviations.
FitOptions trial_options(const FrfEstimate& frf, const FitOptions& options);

/// Some of the lines, inputs and outputs of an FRF, evenly spaced, with a model of them and the options of a fit.
struct PartOfData {
  FrfEstimate frf;
  FitOptions options;
  AdditiveModel model;
  bool all = false;  ///< there are few: these are all
};

/// As many lines and channels as a walk through models needs: at least 500 lines, 20 per mode, up to 128 channels. All, if
/// there are few. Modes between the lines of the part, or at whose nodes its channels are, are found later, on all data.
/// @param options with FitOptions::user_weights, which become those of the part
PartOfData part_of_data(const FrfEstimate& frf, const FitOptions& options,
                        const AdditiveModel& model);

/// The same channels on all lines.
PartOfData part_of_channels(const FrfEstimate& frf, const FitOptions& options,
                            const AdditiveModel& model);

/// Their FRF alone.
FrfEstimate some_channels(const FrfEstimate& frf);

/// use(frf) with those channels, for first guesses of poles; with all, if they are one tile.
template <typename Use>
auto guess_from(const FrfEstimate& frf, const Use& use) {
  return channel_tiles(frf.response.rows()) > 1 ? use(some_channels(frf)) : use(frf);
}

/// The poles and delays of a model of a part, for all channels; of those that were not in it, the mean delay.
AdditiveModel with_all_channels(const FrfEstimate& frf, AdditiveModel model);

}  // namespace stageid
