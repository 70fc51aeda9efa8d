#include "tools/config/controller_file.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/file_error.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/config/config_reader.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/config/stage_expectation.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr std::size_t kMostStates = 1000;
constexpr double kMeasuredError = 0.02;  // relative to C y; of a response between its lines

enum class Time : std::uint8_t { discrete, continuous };

struct StateSpace {
  std::vector<double> a, b, c, d;
};

struct Transfer {
  std::string actuator, sensor;
  std::vector<double> numerator, denominator;
};

/// Content of the file, key by key.
struct ControllerFile {
  std::size_t format = 0;
  std::string stage;
  std::vector<std::string> sensors;
  std::vector<std::string> actuators;
  Time time = Time::discrete;
  double sample_rate_hz = 0.0;
  bool has_state_space = false;
  StateSpace state_space;
  std::vector<Transfer> transfer;
  std::string measured;
};

void describe_matrix(ConfigVisitor& v, const char* key, std::vector<double>& values,
                     Presence presence, const char* help) {
  v.numbers(key, values, any_number(""), {0, kMostStates * kMostStates}, presence, help);
}

void describe_state_space(ConfigVisitor& v, ControllerFile& f) {
  StateSpace& s = f.state_space;
  f.has_state_space = true;
  describe_matrix(v, "a", s.a, kOptional, "states x states, row by row; omitted: no states");
  describe_matrix(v, "b", s.b, kOptional, "states x sensors, row by row");
  describe_matrix(v, "c", s.c, kOptional, "actuators x states, row by row");
  describe_matrix(v, "d", s.d, kOptional, "actuators x sensors, row by row; omitted: zero");
  const auto n = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(s.a.size()))));
  const std::size_t n_y = f.sensors.size();
  const std::size_t n_u = f.actuators.size();
  const auto check = [&](const char* key, std::size_t have, std::size_t rows, std::size_t columns) {
    v.require(have == rows * columns, key,
              fmt::format("{}: got {}; expected a matrix of {} x {}, {} numbers, row by row", key,
                          counted(have, "number"), rows, columns, rows * columns));
  };
  check("a", s.a.size(), n, n);
  check("b", s.b.size(), n, n_y);
  check("c", s.c.size(), n_u, n);
  if (!s.d.empty()) check("d", s.d.size(), n_u, n_y);
  v.require(n > 0 || !s.d.empty(), "d", "d: required for a controller without states");
}

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

void describe_transfer(ConfigVisitor& v, ControllerFile& f) {
  Transfer t;
  v.text("actuator", t.actuator, kRequired, "actuator that it drives");
  v.text("sensor", t.sensor, kRequired, "sensor that it reads");
  v.numbers("numerator", t.numerator, any_number(""), {1, kMostStates}, kRequired,
            "coefficients of falling powers of z or s");
  v.numbers("denominator", t.denominator, any_number(""), {1, kMostStates}, kRequired,
            "coefficients of falling powers of z or s");
  v.require(contains(f.actuators, t.actuator), "actuator",
            fmt::format("actuator: '{}' is not in the list 'actuators'", t.actuator));
  v.require(contains(f.sensors, t.sensor), "sensor",
            fmt::format("sensor: '{}' is not in the list 'sensors'", t.sensor));
  v.require(
      std::any_of(t.denominator.begin(), t.denominator.end(), [](double x) { return x != 0.0; }),
      "denominator",
      "denominator: all coefficients are zero; write at least one nonzero coefficient");
  const bool twice = std::any_of(f.transfer.begin(), f.transfer.end(), [&](const Transfer& other) {
    return other.actuator == t.actuator && other.sensor == t.sensor;
  });
  v.require(!twice, "sensor",
            fmt::format("sensor: duplicate transfer function from '{}' to '{}'; write their sum",
                        t.sensor, t.actuator));
  f.transfer.push_back(std::move(t));
}

void require_unique(ConfigVisitor& v, const char* key, const std::vector<std::string>& names) {
  v.require(std::set<std::string>(names.begin(), names.end()).size() == names.size(), key,
            fmt::format("{}: duplicate channel name; list each channel once", key));
}

void describe(ConfigVisitor& v, ControllerFile& f) {
  v.choice("format", f.format, {"stageid-controller"}, kRequired, "what this file is");
  v.text("stage", f.stage, kOptional,
         "stage file with geometry and mass, relative to this one; omitted: the wiring is not "
         "checked");
  v.texts("sensors", f.sensors, {0, 64}, kOptional, "inputs of the controller, in its order");
  v.texts("actuators", f.actuators, {0, 64}, kOptional, "outputs of the controller, in its order");
  require_unique(v, "sensors", f.sensors);
  require_unique(v, "actuators", f.actuators);
  choose(v, "time", f.time, {"discrete", "continuous"}, kOptional,
         "time domain of matrices and coefficients");
  v.number("sample_rate_hz", f.sample_rate_hz, positive("Hz"), kOptional,
           "of a discrete controller");
  v.group(
      "state_space", [&](ConfigVisitor& group) { describe_state_space(group, f); }, kOptional,
      "matrices from y to C y, u = r - C y");
  v.items(
      "transfer", [&](ConfigVisitor& item) { describe_transfer(item, f); }, {}, kOptional,
      "transfer functions from y to C y, u = r - C y; omitted pairs: zero");
  v.text("measured", f.measured, kOptional,
         "or a frequency response in HDF5, laid out as frf.h5, relative to this file: its inputs "
         "are the sensors, its outputs the actuators");
  const int forms = int{f.has_state_space} + int{!f.transfer.empty()} + int{!f.measured.empty()};
  v.require(forms == 1, "format", "write exactly one of state_space, transfer and measured");
  const bool matrices = f.measured.empty();
  v.require(!matrices || (!f.sensors.empty() && !f.actuators.empty()), "format",
            "sensors, actuators: missing; list the channels of the matrices, in their order");
  v.require(!matrices || f.time == Time::continuous || f.sample_rate_hz > 0.0, "format",
            "sample_rate_hz: required for a discrete controller");
}

Eigen::MatrixXd matrix_of(const std::vector<double>& values, Index rows, Index columns) {
  if (values.empty()) return Eigen::MatrixXd::Zero(rows, columns);
  return Eigen::Map<const Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(values.data(), rows,
                                                                          columns);
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

NominalStage of_state_space(const ControllerFile& f) {
  const auto n_y = static_cast<Index>(f.sensors.size());
  const auto n_u = static_cast<Index>(f.actuators.size());
  const StateSpace& s = f.state_space;
  const Index n = s.a.empty() ? 0 : static_cast<Index>(s.b.size()) / n_y;
  NominalStage nominal;
  nominal.controller = [f, A = matrix_of(s.a, n, n), B = matrix_of(s.b, n, n_y),
                        C = matrix_of(s.c, n_u, n), D = matrix_of(s.d, n_u, n_y)](double hz) {
    Eigen::MatrixXcd response = D.cast<std::complex<double>>();
    if (A.rows() > 0) {
      const Eigen::MatrixXcd M =
          variable_of(f, hz) * Eigen::MatrixXcd::Identity(A.rows(), A.rows()) - A;
      response += C * M.partialPivLu().solve(B.cast<std::complex<double>>());
    }
    return Eigen::MatrixXcd(-response);
  };
  return nominal;
}

NominalStage of_transfer(const ControllerFile& f) {
  NominalStage nominal;
  nominal.controller = [f](double hz) {
    Eigen::MatrixXcd response = Eigen::MatrixXcd::Zero(static_cast<Index>(f.actuators.size()),
                                                       static_cast<Index>(f.sensors.size()));
    const std::complex<double> x = variable_of(f, hz);
    for (const Transfer& t : f.transfer) {
      const auto u = std::find(f.actuators.begin(), f.actuators.end(), t.actuator);
      const auto y = std::find(f.sensors.begin(), f.sensors.end(), t.sensor);
      response(u - f.actuators.begin(), y - f.sensors.begin()) =
          -polynomial(t.numerator, x) / polynomial(t.denominator, x);
    }
    return response;
  };
  return nominal;
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
    const Index above = std::clamp<Index>(std::lower_bound(f.begin(), f.end(), hz) - f.begin(),
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

}  // namespace

bool is_controller_file(const YamlDocument& document) {
  const auto& entries = document.root().entries;
  return std::any_of(entries.begin(), entries.end(), [&](const YamlNode::Entry& entry) {
    return entry.key == "format" && document.node(entry.value).text == "stageid-controller";
  });
}

NominalStage read_controller_file(const YamlDocument& document) {
  ControllerFile f;
  read_config(document, [&](ConfigVisitor& visitor) {
    f = ControllerFile{};
    describe(visitor, f);
  });
  const std::filesystem::path folder = document.file().parent_path();
  NominalStage nominal = f.has_state_space     ? of_state_space(f)
                         : !f.transfer.empty() ? of_transfer(f)
                                               : of_measured(folder / f.measured);
  if (f.measured.empty()) {
    nominal.sensors = f.sensors;
    nominal.actuators = f.actuators;
  }
  if (!f.stage.empty()) {
    const NominalStage stage = nominal_stage(load_stage_config(folder / f.stage).spec);
    std::string missing;
    const auto y = positions_in(stage.sensors, nominal.sensors, missing);
    const auto u = positions_in(stage.actuators, nominal.actuators, missing);
    if (!missing.empty())
      throw FormatError(document.file(), "",
                        fmt::format("stage: {} has no channel '{}'; use the names of the stage "
                                    "file",
                                    f.stage, missing));
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
