#pragma once

#include <string>
#include <string_view>

namespace stageid {

/// The state of a measurement in the text format of Prometheus, version 0.0.4, as in docs/formats.md.
/// @param state the JSON that the dashboard streams; what it lacks is left out
/// Source: https://prometheus.io/docs/instrumenting/exposition_formats/
std::string metrics_text(std::string_view state);

}  // namespace stageid
