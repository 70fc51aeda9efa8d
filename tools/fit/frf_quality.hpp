#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "frf/response/frf_estimate.hpp"

/// Quality of a measured frequency response, for people and for scripts.
namespace stageid {

/// Table of the linearity test, one row per band: number of nonlinear output-input pairs, the most nonlinear one, and
/// the level of distortions on even and odd detection lines. One line with the reason if it could not be tested.
std::vector<std::string> linearity_lines(const FrfEstimate& frf);

/// {"tested": false, "reason": ...}, or "nonlinear" (any verdict, given their number), "false_alarm_rate" per verdict,
/// and "bands": band_hz, tests, nonlinear; output, input, p_value and distortion of the least probable pair; even and
/// odd: p_value and level of the least probable one, or null without such lines.
nlohmann::ordered_json linearity_json(const FrfEstimate& frf);

/// Excluded realizations and periods, and replaced samples, with the reasons, one line each; only the first ones of
/// very many.
std::vector<std::string> dropped_lines(const FrfEstimate& frf);

/// [{"realization": 1, "reason": ...}, ...], counted from 1.
nlohmann::ordered_json left_out_json(const FrfEstimate& frf);

/// [{"realization": 1, "experiment": 1, "period": 3, "reason": ...}, ...], counted from 1.
nlohmann::ordered_json dropped_json(const FrfEstimate& frf);

/// [{"realization": 1, "experiment": 1, "period": 3, "first_sample": 12, "samples": 6, "reason": ...}, ...], counted
/// from 1.
nlohmann::ordered_json replaced_json(const FrfEstimate& frf);

}  // namespace stageid
