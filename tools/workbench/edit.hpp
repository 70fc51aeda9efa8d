#pragma once

#include <string>

#include "estimation/request/fit_request.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// A changed request, and the change in words: "added 81.23 Hz".
struct Edit {
  FitRequest request;
  std::string what;
};

/// Applies an action of the page to a request with given modes (or none):
///   {"kind": "add", "frequency_hz", "damping_ratio"}    {"kind": "remove", "frequency_hz"}
///   {"kind": "band", "low_hz", "high_hz"}, null: all lines
///   {"kind": "refit", "weighting", "damping", "residue_rank", "delay", "rigid_body", "direct_term", "modes"}: the words
///   of the flags; missing: unchanged, empty: the default. "modes": "auto" or a number.
/// Nothing in an action names a file.
/// @throws std::invalid_argument what is wrong with it, for the user
Edit edited(const SortedJson& action, FitRequest request);

/// The request in the words of the controls, for the page: the keys of "refit", and "band_hz".
SortedJson controls_json(const FitRequest& request);

}  // namespace stageid
