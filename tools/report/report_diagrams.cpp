#include "tools/report/report_diagrams.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/modal/modal_assurance.hpp"

namespace stageid::report {
namespace {

/// For shapes of norm one; a pixel is a thousandth.
constexpr int kShapeDigits = 5;

SortedJson rounded(double value, int digits) {
  if (!std::isfinite(value)) return SortedJson();
  const double scale = std::pow(10.0, digits);
  return std::round(value * scale) / scale;
}

/// Four digits; null if it is not finite.
SortedJson significant(double value) {
  if (!std::isfinite(value) || value == 0.0)
    return std::isfinite(value) ? SortedJson(0.0) : SortedJson();
  const double scale = std::pow(10.0, 3.0 - std::floor(std::log10(std::abs(value))));
  const double rounded = std::round(value * scale) / scale;
  return std::isfinite(rounded) ? SortedJson(rounded) : SortedJson(value);
}

SortedJson pairs(const Eigen::VectorXcd& shape) {
  SortedJson out = SortedJson::array();
  for (const std::complex<double> value : shape) {
    out.push_back(rounded(value.real(), kShapeDigits));
    out.push_back(rounded(value.imag(), kShapeDigits));
  }
  return out;
}

SortedJson places(const std::vector<Channel>& places, const ChannelList& channels) {
  SortedJson out = SortedJson::array();
  for (const std::string& name : channels.names) {
    const auto place = std::ranges::find(places, name, &Channel::name);
    out.push_back(place == places.end() ? SortedJson()
                                        : SortedJson{{"position_m", place->position_m},
                                                     {"direction", place->direction}});
  }
  return out;
}

}  // namespace

SortedJson rounded_mac(double value) { return rounded(value, 4); }

SortedJson matrix_json(const Eigen::MatrixXd& matrix, SortedJson (*rounding)(double)) {
  SortedJson out = SortedJson::array();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    SortedJson line = SortedJson::array();
    for (const double value : matrix.row(row)) line.push_back(rounding(value));
    out.push_back(std::move(line));
  }
  return out;
}

SortedJson stabilization_json(const std::vector<StabilizationPole>& poles) {
  SortedJson out = SortedJson::array();
  for (const StabilizationPole& pole : poles)
    out.push_back({pole.order, std::round(1e4 * pole.frequency_hz) / 1e4,
                   significant(pole.damping_ratio),
                   pole.stable_damping ? 2 : static_cast<int>(pole.stable_frequency)});
  return out;
}

SortedJson nonlinearity_json(const NonlinearityTest& test) {
  SortedJson settled = SortedJson::array();
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b) settled.push_back(test.settled(b));
  return {{"bands", matrix_json(test.band_hz, significant)},
          {"settled", std::move(settled)},
          {"p_value", matrix_json(test.p_value, significant)},
          {"distortion", matrix_json(test.distortion, significant)},
          {"chance", kNonlinearBelow}};
}

std::vector<ModeShape> shapes_by_frequency(const AdditiveModel& model) {
  std::vector<ModeShape> modes = mode_shapes(model);
  std::ranges::stable_sort(modes, {}, &ModeShape::natural_frequency_hz);
  return modes;
}

SortedJson shapes_json(const AdditiveModel& model) {
  const std::vector<ModeShape> modes = shapes_by_frequency(model);
  SortedJson list = SortedJson::array();
  for (const ModeShape& mode : modes)
    list.push_back({{"frequency_hz", mode.natural_frequency_hz},
                    {"damping_ratio", mode.damping_ratio},
                    {"modal_mass", mode.modal_mass},  // infinite: null in the page
                    {"not_rank_one", rounded(mode.not_rank_one, kShapeDigits)},
                    {"outputs", pairs(mode.output_shape)},
                    {"inputs", pairs(mode.input_shape)}});
  const Eigen::MatrixXcd outputs = output_shapes(modes);
  const Eigen::MatrixXcd inputs = input_shapes(modes);
  return {{"modes", list},
          {"output_mac", matrix_json(modal_assurance(outputs, outputs), rounded_mac)},
          {"input_mac", matrix_json(modal_assurance(inputs, inputs), rounded_mac)}};
}

SortedJson geometry_json(const StageInfo& geometry, const ChannelList& outputs,
                         const ChannelList& inputs) {
  SortedJson out = {{"outputs", places(geometry.sensors, outputs)},
                    {"inputs", places(geometry.actuators, inputs)}};
  const auto known = [](const SortedJson& list) {
    return std::ranges::any_of(list, [](const SortedJson& place) { return !place.is_null(); });
  };
  return known(out["outputs"]) || known(out["inputs"]) ? out : SortedJson();
}

}  // namespace stageid::report
