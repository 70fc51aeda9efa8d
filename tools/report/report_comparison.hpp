#pragma once

#include <nlohmann/json.hpp>

#include "tools/report/report.hpp"

namespace stageid::report {

/// What is known of another day or another model, on the lines of `own.frf` where there is one.
/// Its response is left out, with a message in own.messages, where it was measured on other lines or compensated
/// otherwise, or is own.frf itself.
/// @param model, frf may be missing, not both
/// @throws std::invalid_argument if its channels are not those of `own`, by name and in order; `title` is named.
ReportComparison make_comparison(ReportData& own, std::string title,
                                 std::optional<AdditiveModel> model,
                                 const std::optional<FrfEstimate>& frf);

/// {"title", "modes": [{frequency_hz, frequency_std_hz, damping_ratio, damping_std}], "own": [the same of the
/// report's model], "pairs": [{own, other, frequency_difference, frequency_deviation, damping_difference,
/// damping_deviation, output_mac, input_mac}], "output_mac", "input_mac": own modes x other modes}.
/// Both lists by frequency; differences other less own, relative; deviations in standard deviations of the
/// difference of two independent estimates, null where one is unknown. Without two models: only the title.
nlohmann::json comparison_json(const ReportData& own);

}  // namespace stageid::report
