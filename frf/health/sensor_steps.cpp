#include "frf/health/sensor_steps.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "frf/response/nonlinearity.hpp"

namespace stageid {
namespace {

constexpr double kLeastShare = 0.25;

bool tests_nonlinear(const FrfEstimate& frf, Eigen::Index output) {
  const NonlinearityTest& test = frf.nonlinearity;
  for (Eigen::Index u = 0; u < frf.n_inputs(); ++u)
    if (test.p_value.row(output + frf.n_outputs() * u).minCoeff() < kNonlinearBelow) return true;
  return false;
}

/// Index in the list of the log, or none.
std::optional<Eigen::Index> place_of(const std::string& name, const ChannelList& list) {
  const auto at = std::ranges::find(list.names, name);
  if (at == list.names.end()) return std::nullopt;
  return at - list.names.begin();
}

/// Rows of the record's spectra; empty if an input is not recorded.
std::vector<Eigen::Index> rows_of_inputs(const FrfEstimate& frf, const HealthRecord& record) {
  std::vector<Eigen::Index> rows;
  for (const std::string& name : frf.inputs.names) {
    const auto at = place_of(name, record.info.actuators);
    if (!at) return {};
    rows.push_back(record.n_y() + *at);
  }
  return rows;
}

/// (total variance - noise) / (variance by steps of size 1) of an output, mean over the record's lines and the inputs;
/// infinite if no line is known.
double excess_over_steps(const FrfEstimate& frf, const HealthRecord& record, Eigen::Index output,
                         const std::vector<Eigen::Index>& inputs) {
  const double of_line = 1.0 / (12.0 * record.info.period_samples * frf.realizations);
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < record.lines.size(); ++i) {
    const double f = record.frequency_hz[i];
    const auto at = std::ranges::lower_bound(frf.frequency_hz, f * (1.0 - 1e-9));
    if (at == frf.frequency_hz.end() || std::abs(*at - f) > 1e-9 * f) continue;
    const Eigen::MatrixXcd U = record.mean(record.lines[i].Z)(inputs, Eigen::all);
    const Eigen::VectorXd gain = (U * U.adjoint()).inverse().diagonal().real();
    const Eigen::Index k = at - frf.frequency_hz.begin();
    for (Eigen::Index u = 0; u < gain.size(); ++u) {
      const Eigen::Index c = output + frf.n_outputs() * u;
      sum += (frf.total_variance(c, k) - frf.noise_variance(c, k)) / (of_line * gain[u]);
      ++count;
    }
  }
  return count > 0 ? sum / count : HUGE_VAL;
}

}  // namespace

std::vector<Finding> check_sensor_steps(const FrfEstimate& frf, const HealthRecord& record) {
  if (!frf.nonlinearity.nonlinear() || frf.total_variance.size() == 0 ||
      frf.noise_variance.size() == 0 || record.experiments() < frf.n_inputs())
    return {};
  const std::vector<Eigen::Index> inputs = rows_of_inputs(frf, record);
  std::vector<Finding> findings;
  for (Eigen::Index y = 0; y < frf.n_outputs(); ++y) {
    if (!tests_nonlinear(frf, y)) continue;
    const auto sensor = place_of(frf.outputs.name(y), record.info.sensors);
    if (!sensor || inputs.empty()) return {};
    const double step = record.scan[*sensor].step();
    if (!(step > 0.0) || kLeastShare * excess_over_steps(frf, record, y, inputs) > step * step)
      return {};
    findings.push_back({Severity::doubt, Cause::resolution, frf.outputs.name(y),
                        "its converter is coarse for this motion; the error of its steps repeats "
                        "with the period, as nonlinearity of the plant would",
                        fmt::format("steps of {:.4g} {}", step, frf.outputs.unit(y)),
                        "raise the level, or use a finer range"});
  }
  return findings;
}

}  // namespace stageid
