#include "tools/report/report_diagrams.hpp"

#include <cmath>

namespace stageid::report {
namespace {

using Json = nlohmann::json;

Json significant(double value) {
  if (!std::isfinite(value) || value == 0.0) return std::isfinite(value) ? Json(0.0) : Json();
  const double scale = std::pow(10.0, 3.0 - std::floor(std::log10(std::abs(value))));
  const double rounded = std::round(value * scale) / scale;
  return std::isfinite(rounded) ? Json(rounded) : Json(value);
}

Json rows_of(const Eigen::MatrixXd& matrix) {
  Json out = Json::array();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    Json line = Json::array();
    for (const double value : matrix.row(row)) line.push_back(significant(value));
    out.push_back(std::move(line));
  }
  return out;
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
  return {{"bands", rows_of(test.band_hz)},
          {"settled", std::move(settled)},
          {"p_value", rows_of(test.p_value)},
          {"distortion", rows_of(test.distortion)},
          {"chance", kNonlinearBelow}};
}

}  // namespace stageid::report
