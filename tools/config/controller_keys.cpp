#include "tools/config/controller_keys.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr std::size_t kMostStates = 1000;

void describe_matrix(ConfigVisitor& v, const char* key, std::vector<double>& values,
                     const char* help) {
  v.numbers(key, values, any_number(""), {0, kMostStates * kMostStates}, kOptional, help);
}

void describe_state_space(ConfigVisitor& v, LinearControllerKeys& keys) {
  LinearControllerKeys::StateSpace& s = keys.state_space;
  keys.has_state_space = true;
  describe_matrix(v, "a", s.a, "states x states, row by row; omitted: no states");
  describe_matrix(v, "b", s.b, "states x sensors, row by row");
  describe_matrix(v, "c", s.c, "actuators x states, row by row");
  describe_matrix(v, "d", s.d, "actuators x sensors, row by row; omitted: zero");
  const auto n = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(s.a.size()))));
  const std::size_t n_y = keys.sensors.size();
  const std::size_t n_u = keys.actuators.size();
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
  return std::ranges::find(names, name) != names.end();
}

void describe_transfer(ConfigVisitor& v, LinearControllerKeys& keys) {
  LinearControllerKeys::Transfer t;
  v.text("actuator", t.actuator, kRequired, "actuator that it drives");
  v.text("sensor", t.sensor, kRequired, "sensor that it reads");
  v.numbers("numerator", t.numerator, any_number(""), {1, kMostStates}, kRequired,
            "coefficients of falling powers of z or s");
  v.numbers("denominator", t.denominator, any_number(""), {1, kMostStates}, kRequired,
            "coefficients of falling powers of z or s");
  v.require(contains(keys.actuators, t.actuator), "actuator",
            fmt::format("actuator: '{}' is not in the list 'actuators'", t.actuator));
  v.require(contains(keys.sensors, t.sensor), "sensor",
            fmt::format("sensor: '{}' is not in the list 'sensors'", t.sensor));
  v.require(std::ranges::any_of(t.denominator, [](double x) { return x != 0.0; }), "denominator",
            "denominator: all coefficients are zero; write at least one nonzero coefficient");
  const bool twice = std::ranges::any_of(keys.transfer, [&](const auto& other) {
    return other.actuator == t.actuator && other.sensor == t.sensor;
  });
  v.require(!twice, "sensor",
            fmt::format("sensor: duplicate transfer function from '{}' to '{}'; write their sum",
                        t.sensor, t.actuator));
  keys.transfer.push_back(std::move(t));
}

std::vector<Index> positions(const std::vector<std::string>& names,
                             const std::vector<Channel>& channels) {
  std::vector<Index> out;
  for (const std::string& name : names) {
    const int index = channel_index(channels, name);
    if (index < 0)
      fail_request("controller: the stage has no channel '{}'; use the names of the stage file",
                   name);
    out.push_back(index);
  }
  return out;
}

}  // namespace

void describe_linear_controller(ConfigVisitor& v, LinearControllerKeys& keys) {
  group(v, "state_space", describe_state_space, keys, kOptional,
        "matrices from y to C y, u = r - C y");
  items(v, "transfer", describe_transfer, keys, {}, kOptional,
        "transfer functions from y to C y, u = r - C y; omitted pairs: zero");
}

Eigen::MatrixXd matrix_of(const std::vector<double>& values, Index rows, Index columns) {
  if (values.empty()) return Eigen::MatrixXd::Zero(rows, columns);
  return Eigen::Map<const Eigen::Matrix<double, -1, -1, Eigen::RowMajor>>(values.data(), rows,
                                                                          columns);
}

void take_linear_controller(const LinearControllerKeys& keys, const std::vector<Channel>& actuators,
                            const std::vector<Channel>& sensors, MotionControllerSpec& spec) {
  const std::vector<Index> u = positions(keys.actuators, actuators);
  const std::vector<Index> y = positions(keys.sensors, sensors);
  if (keys.has_state_space) {
    const auto n_u = static_cast<Index>(u.size());
    const auto n_y = static_cast<Index>(y.size());
    const LinearControllerKeys::StateSpace& s = keys.state_space;
    const Index n = s.a.empty() ? 0 : static_cast<Index>(s.b.size()) / n_y;
    ControllerStateSpace& out = spec.state_space;
    out.a = matrix_of(s.a, n, n);
    out.b = Eigen::MatrixXd::Zero(n, static_cast<Index>(sensors.size()));
    out.c = Eigen::MatrixXd::Zero(static_cast<Index>(actuators.size()), n);
    out.d = Eigen::MatrixXd::Zero(out.c.rows(), out.b.cols());
    out.b(Eigen::all, y) = matrix_of(s.b, n, n_y);
    out.c(u, Eigen::all) = matrix_of(s.c, n_u, n);
    out.d(u, y) = matrix_of(s.d, n_u, n_y);
  }
  for (const LinearControllerKeys::Transfer& t : keys.transfer)
    spec.transfer.push_back({channel_index(actuators, t.actuator), channel_index(sensors, t.sensor),
                             t.numerator, t.denominator});
}

}  // namespace stageid
