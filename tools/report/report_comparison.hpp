#pragma once

#include "tools/report/report_page.hpp"
#include "tools/terminal/json.hpp"

namespace stageid::report {

/// Compares with another day or another model, on the lines of `own.frf` if there is one. Its response is omitted,
/// with a line in own.notes, if its lines or its compensation differ, or if it is own.frf itself.
/// @param model, frf at least one is required
/// @throws std::invalid_argument naming `title` if its channels are not those of `own`, by name and in order.
ReportComparison make_comparison(ReportData& own, std::string title,
                                 std::optional<AdditiveModel> model,
                                 const std::optional<FrfEstimate>& frf);

/// {"title", "modes": [{frequency_hz, frequency_std_hz, damping_ratio, damping_std}], "own": [the same of the
/// report's model], "pairs": [{own, other, frequency_difference, frequency_deviation, damping_difference,
/// damping_deviation, output_mac, input_mac}], "output_mac", "input_mac": own modes x other modes}.
/// Both lists are sorted by frequency. Differences are other minus own, relative; deviations are in standard
/// deviations of the difference of two independent estimates, null if one is unknown. Without two models: only the
/// title.
SortedJson comparison_json(const ReportData& own);

}  // namespace stageid::report
