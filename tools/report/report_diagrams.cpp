#include "tools/report/report_diagrams.hpp"

#include <cmath>

#include "tools/report/report_shapes.hpp"

namespace stageid::report {
namespace {

using Json = nlohmann::json;

Json significant(double value) {
  if (!std::isfinite(value) || value == 0.0) return std::isfinite(value) ? Json(0.0) : Json();
  const double scale = std::pow(10.0, 3.0 - std::floor(std::log10(std::abs(value))));
  const double rounded = std::round(value * scale) / scale;
  return std::isfinite(rounded) ? Json(rounded) : Json(value);
}

}  // namespace

Json stabilization_json(const std::vector<StabilizationPole>& poles) {
  Json out = Json::array();
  for (const StabilizationPole& pole : poles)
    out.push_back({pole.order, std::round(1e4 * pole.frequency_hz) / 1e4,
                   significant(pole.damping_ratio),
                   pole.stable_damping ? 2 : static_cast<int>(pole.stable_frequency)});
  return out;
}

Json nonlinearity_json(const NonlinearityTest& test) {
  Json settled = Json::array();
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b) settled.push_back(test.settled(b));
  return {{"bands", matrix_json(test.band_hz, significant)},
          {"settled", std::move(settled)},
          {"p_value", matrix_json(test.p_value, significant)},
          {"distortion", matrix_json(test.distortion, significant)},
          {"chance", kNonlinearBelow}};
}

}  // namespace stageid::report
