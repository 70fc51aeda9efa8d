#include "tools/config/controller_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <complex>
#include <memory>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "excitation/words/words.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/config/stage_expectation.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kMeasuredError = 0.02;  // relative to C y; of a response between its lines

enum class Time : std::uint8_t { discrete, continuous };

}  // namespace

template <>
inline constexpr std::array kWords<Time> = {"discrete", "continuous"};

namespace {

/// Content of the file, key by key.
struct ControllerFile {
  std::size_t format = 0;
  std::string stage;
  Time time = Time::discrete;
  double sample_rate_hz = 0.0;
  LinearControllerKeys linear;
  std::string measured;
};

void require_unique(ConfigVisitor& v, const char* key, const std::vector<std::string>& names) {
  v.require(std::set<std::string>(names.begin(), names.end()).size() == names.size(), key,
            fmt::format("{}: duplicate channel name; list each channel once", key));
}

void describe(ConfigVisitor& v, ControllerFile& f) {
  v.choice("format", f.format, {"stageid-controller"}, kRequired, "what this file is");
  v.text("stage", f.stage, kOptional,
         "stage file with geometry and mass, relative to this one; omitted: the wiring is not "
         "checked");
  v.texts("sensors", f.linear.sensors, {0, 64}, kOptional,
          "inputs of the controller, in its order");
  v.texts("actuators", f.linear.actuators, {0, 64}, kOptional,
          "outputs of the controller, in its order");
  require_unique(v, "sensors", f.linear.sensors);
  require_unique(v, "actuators", f.linear.actuators);
  choose(v, "time", f.time, kOptional, "time domain of matrices and coefficients");
  v.number("sample_rate_hz", f.sample_rate_hz, positive("Hz"), kOptional,
           "of a discrete controller");
  describe_linear_controller(v, f.linear);
  v.text("measured", f.measured, kOptional,
         "or a frequency response in HDF5, laid out as frf.h5, relative to this file: its inputs "
         "are the sensors, its outputs the actuators");
  const int forms =
      int{f.linear.has_state_space} + int{!f.linear.transfer.empty()} + int{!f.measured.empty()};
  v.require(forms == 1, "format", "write exactly one of state_space, transfer and measured");
  const bool matrices = f.measured.empty();
  v.require(!matrices || (!f.linear.sensors.empty() && !f.linear.actuators.empty()), "format",
            "sensors, actuators: missing; list the channels of the matrices, in their order");
  v.require(!matrices || f.time == Time::continuous || f.sample_rate_hz > 0.0, "format",
            "sample_rate_hz: required for a discrete controller");
}

/// z or s at a frequency.
std::complex<double> variable_of(const ControllerFile& f, double frequency_hz) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  return f.time == Time::discrete ? std::polar(1.0, omega / f.sample_rate_hz)
                                  : std::complex<double>(0.0, omega);
}

std::complex<double> polynomial(const std::vector<double>& coefficients, std::complex<double> x) {
  std::complex<double> sum = 0.0;
  for (const double c : coefficients) sum = sum * x + c;
  return sum;
}

using ControllerResponse = decltype(NominalStage::controller);

ControllerResponse response_of_state_space(const ControllerFile& f) {
  const auto n_y = static_cast<Index>(f.linear.sensors.size());
  const auto n_u = static_cast<Index>(f.linear.actuators.size());
  const LinearControllerKeys::StateSpace& s = f.linear.state_space;
  const Index n = s.a.empty() ? 0 : static_cast<Index>(s.b.size()) / n_y;
  return [f, A = matrix_of(s.a, n, n), B = matrix_of(s.b, n, n_y), C = matrix_of(s.c, n_u, n),
          D = matrix_of(s.d, n_u, n_y)](double hz) {
    Eigen::MatrixXcd response = D.cast<std::complex<double>>();
    if (A.rows() > 0) {
      const Eigen::MatrixXcd M =
          variable_of(f, hz) * Eigen::MatrixXcd::Identity(A.rows(), A.rows()) - A;
      response += C * solve(M, B.cast<std::complex<double>>());
    }
    return Eigen::MatrixXcd(-response);
  };
}

ControllerResponse response_of_transfer(const ControllerFile& f) {
  return [f](double hz) {
    Eigen::MatrixXcd response = Eigen::MatrixXcd::Zero(
        static_cast<Index>(f.linear.actuators.size()), static_cast<Index>(f.linear.sensors.size()));
    const std::complex<double> x = variable_of(f, hz);
    for (const LinearControllerKeys::Transfer& t : f.linear.transfer) {
      const auto u = std::ranges::find(f.linear.actuators, t.actuator);
      const auto y = std::ranges::find(f.linear.sensors, t.sensor);
      response(u - f.linear.actuators.begin(), y - f.linear.sensors.begin()) =
          -polynomial(t.numerator, x) / polynomial(t.denominator, x);
    }
    return response;
  };
}

/// Interpolates linearly between two lines.
NominalStage of_measured(const std::filesystem::path& file) {
  const auto frf = std::make_shared<const FrfEstimate>(read_frf(file));
  NominalStage nominal;
  nominal.sensors = frf->inputs.names;
  nominal.actuators = frf->outputs.names;
  nominal.controller_from_hz = frf->frequency_hz[0];
  nominal.controller_to_hz = frf->frequency_hz[frf->lines() - 1];
  nominal.controller_error = kMeasuredError;
  nominal.controller = [frf](double hz) {
    const Eigen::VectorXd& f = frf->frequency_hz;
    const Index above = std::clamp<Index>(std::ranges::lower_bound(f, hz) - f.begin(),
                                          std::min<Index>(1, f.size() - 1), f.size() - 1);
    const Index below = std::max<Index>(0, above - 1);
    const double span = f[above] - f[below];
    const double share = span > 0.0 ? (hz - f[below]) / span : 0.0;
    const Eigen::VectorXcd at =
        (1.0 - share) * frf->response.col(below) + share * frf->response.col(above);
    return Eigen::MatrixXcd(
        -Eigen::Map<const Eigen::MatrixXcd>(at.data(), frf->n_outputs(), frf->n_inputs()));
  };
  return nominal;
}

ControllerFile read_keys(const YamlDocument& document) {
  ControllerFile f;
  read_config(document, [&](ConfigVisitor& visitor) { describe(visitor, f); });
  return f;
}

}  // namespace

bool is_controller_file(const YamlDocument& document) {
  const YamlNode* format = document.value(document.root(), "format");
  return format != nullptr && format->text == "stageid-controller";
}

LinearControllerKeys read_discrete_controller(const YamlDocument& document,
                                              double& sample_rate_hz) {
  const ControllerFile f = read_keys(document);
  if (f.linear.empty() || f.time != Time::discrete)
    throw FormatError(document.file(), "",
                      "the controller cannot be computed sample by sample. Write a discrete "
                      "state_space or transfer");
  sample_rate_hz = f.sample_rate_hz;
  return f.linear;
}

NominalStage read_controller_file(const YamlDocument& document) {
  const ControllerFile f = read_keys(document);
  const std::filesystem::path folder = document.file().parent_path();
  NominalStage nominal;
  if (!f.measured.empty()) {
    nominal = of_measured(folder / f.measured);
  } else {
    if (f.time == Time::discrete) nominal.sample_rate_hz = f.sample_rate_hz;
    nominal.sensors = f.linear.sensors;
    nominal.actuators = f.linear.actuators;
    nominal.controller =
        f.linear.has_state_space ? response_of_state_space(f) : response_of_transfer(f);
  }
  if (!f.stage.empty()) {
    const StageConfig config = load_stage_config(folder / f.stage);
    const NominalStage stage = nominal_stage(config.spec, config.plant);
    std::string missing;
    const auto y = positions_in(stage.sensors, nominal.sensors, &missing);
    const auto u = positions_in(stage.actuators, nominal.actuators, &missing);
    if (!missing.empty())
      fail_format(document.file(), "",
                  "stage: {} has no channel '{}'; use the names of the stage file", f.stage,
                  missing);
    nominal.rigid_body = [stage, y, u](double hz) {
      return Eigen::MatrixXcd(stage.rigid_body(hz)(y, u));
    };
    nominal.free_from_hz = stage.free_from_hz;
  }
  return nominal;
}

void describe_controller_keys(ConfigVisitor& visitor) {
  ControllerFile file;
  describe(visitor, file);
}

}  // namespace stageid
