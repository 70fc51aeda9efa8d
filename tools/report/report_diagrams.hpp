#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "estimation/start/stabilization.hpp"
#include "frf/response/nonlinearity.hpp"
#include "tools/report/report_page.hpp"

namespace stageid::report {

/// [[order, frequency_hz, damping_ratio, stability], ...]; stability 0: new, 1: frequency, 2: damping too.
nlohmann::json stabilization_json(const std::vector<StabilizationPole>& poles);

/// {"bands": [[low_hz, high_hz], ...], "p_value": [[channel], [band]], "distortion": the same,
/// "chance": share of tests that a linear plant fails by chance}; channel = output + outputs * input.
nlohmann::json nonlinearity_json(const NonlinearityTest& test);

}  // namespace stageid::report
