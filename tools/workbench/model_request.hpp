#pragma once

#include "estimation/request/fit_request.hpp"
#include "tools/fit/fit_words.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// The words of the flags of a request, as flags_of() writes them. They may come from elsewhere, so no word may name a
/// file to read now.
FitWords words_of_flags(const Json& flags);

/// The request of a model as its provenance tells; the default if it tells nothing.
/// @throws std::invalid_argument, FileError for flags that are not those of a fit
FitRequest request_of(const AdditiveModel& model);

/// The request for a fit from the modes of `model` with its structure, as a search or the request chose it. Frequencies
/// are rounded to 7 digits and damping ratios to 4: as start values they are exact enough, and commands remain short.
/// @param lowest_hz lowest line; a requested suspension contains the modes below it
/// @throws std::invalid_argument if a requested submodel is part of the model
FitRequest with_modes_of(const AdditiveModel& model, FitRequest request, double lowest_hz);

/// A start value for a fit, rounded as above.
ModeCandidate rounded_mode(double frequency_hz, double damping_ratio);

}  // namespace stageid
