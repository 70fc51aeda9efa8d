#pragma once

#include <nlohmann/json.hpp>

#include "estimation/request/fit_request.hpp"

namespace stageid {

/// The members that are set, as flags of `stageid fit` with their values: {"--band": "30 2000", "--modes": "12.5,80:0.02",
/// "--submodel": [...]}. Numbers have all their digits.
nlohmann::ordered_json flags_of(const FitRequest& request);

}  // namespace stageid
