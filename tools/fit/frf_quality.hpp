#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "frf/response/frf_estimate.hpp"

/// What a frequency response says of its measurement, for people and for scripts.
namespace stageid {

/// A table of the test of linearity, a row a band: how many output-input pairs are nonlinear, which
/// most, and how strong the distortions on even and odd detection lines are. One line with the
/// reason if it could not be tested.
std::vector<std::string> linearity_lines(const FrfEstimate& frf);

/// {"tested": false, "reason": ...}, or "nonlinear" (any verdict, counting how many there are),
/// "false_alarm_rate" of one verdict, and "bands": band_hz, tests, nonlinear, output, input,
/// p_value, distortion of the pair of least probability; even and odd: p_value and level where least
/// probable, or null without such lines.
nlohmann::ordered_json linearity_json(const FrfEstimate& frf);

/// Which realizations and which periods of the others were left out and why, one line each; of very
/// many periods the first ones.
std::vector<std::string> dropped_lines(const FrfEstimate& frf);

/// [{"realization": 1, "reason": ...}, ...], counted from 1.
nlohmann::ordered_json left_out_json(const FrfEstimate& frf);

/// [{"realization": 1, "experiment": 1, "period": 3, "reason": ...}, ...], counted from 1.
nlohmann::ordered_json dropped_json(const FrfEstimate& frf);

}  // namespace stageid
