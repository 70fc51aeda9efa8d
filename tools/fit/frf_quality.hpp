#pragma once

#include <string>
#include <vector>

#include "frf/response/frf_estimate.hpp"
#include "tools/terminal/json.hpp"

/// Quality of a measured frequency response, for people and for scripts.
namespace stageid {

/// Table of the linearity test, one row per band: number of nonlinear output-input pairs, the most nonlinear one, and
/// the level of distortions on even and odd detection lines. One line with the reason if it could not be tested.
std::vector<std::string> linearity_lines(const FrfEstimate& frf);

/// Excluded realizations and periods, and replaced samples, with the reasons, one line each; only the first ones of
/// very many.
std::vector<std::string> dropped_lines(const FrfEstimate& frf);

/// "nonlinearity": {"tested": false, "reason": ...}, or "nonlinear" (any verdict, given their number),
/// "false_alarm_rate" per verdict, and "bands": band_hz, tests, nonlinear; output, input, p_value and distortion of the
/// least probable pair; even and odd: p_value and level of the least probable one, or null without such lines.
/// "dropped_periods", "replaced_samples" and "left_out_realizations": lists with places, counted from 1, and reasons.
Json quality_json(const FrfEstimate& frf);

}  // namespace stageid
