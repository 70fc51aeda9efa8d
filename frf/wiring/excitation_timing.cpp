#include "frf/wiring/excitation_timing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <string>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "excitation/multisine/dft.hpp"
#include "frf/runs/channel_choice.hpp"

namespace stageid {
namespace {

using Eigen::Index;

constexpr double kLeastReduction = 4.0;
constexpr double kClearly = 2.0;  // ratio of the misfits of two explanations
constexpr Index kFewestLines = 8;

/// One excited axis on one line of one experiment, relative to |r|.
struct Entry {
  Index experiment = 0;
  int line = 0;
  std::complex<double> u;           // over r
  std::complex<double> controlled;  // -C y over r
};

/// Whether the controller between the recorded channels is known.
bool knows_all(const HealthRecord& record, const std::optional<NominalStage>& nominal,
               std::vector<Index>& u, std::vector<Index>& y) {
  if (!nominal || !nominal->controller) return false;
  u = positions_in(nominal->actuators, record.info.actuators.names);
  y = positions_in(nominal->sensors, record.info.sensors.names);
  return !u.empty() && !y.empty() && y.size() == nominal->sensors.size();
}

class Alignment {
 public:
  Alignment(const HealthRecord& record, const std::optional<NominalStage>& nominal)
      : period_(record.info.period_samples), experiments_(record.experiments()) {
    const std::vector<Index> actuators = excited_actuators(record.info, record.axes);
    if (actuators.empty()) return;
    std::vector<Index> u;
    std::vector<Index> y;
    controller_known_ = knows_all(record, nominal, u, y);
    const Index K = record.frequency_hz.size();
    for (Index k = 0; k < K; ++k) {
      const double frequency_hz = record.frequency_hz[k];
      if (!controller_known_ && frequency_hz < 0.5 * record.frequency_hz[K - 1]) continue;
      const LineRecord& line = record.lines[k];
      const Eigen::MatrixXcd Z = record.mean(line.Z);
      const Eigen::MatrixXcd U = Z.bottomRows(record.n_u());
      Eigen::MatrixXcd controlled = Eigen::MatrixXcd::Zero(U.rows(), U.cols());
      if (controller_known_)
        controlled = nominal->controller(frequency_hz)(u, y) * Z.topRows(record.n_y());
      const int at = static_cast<int>(
          std::lround(frequency_hz * record.info.period_samples / record.info.sample_rate_hz));
      for (Index e = 0; e < experiments_; ++e)
        for (std::size_t a = 0; a < actuators.size(); ++a) {
          const std::complex<double> r = line.R(record.axes[a], e);
          if (std::abs(r) == 0.0) continue;
          entries_.push_back({e, at, U(actuators[a], e) / r, controlled(actuators[a], e) / r});
        }
    }
  }

  std::optional<ExcitationDelay> find() const {
    if (std::ssize(entries_) < kFewestLines * experiments_) return std::nullopt;
    const int samples = best();
    if (samples == 0) return std::nullopt;
    const Eigen::VectorXd as_recorded = misfit_of_r(0);
    const Eigen::VectorXd aligned = misfit_of_r(samples);
    if (!(aligned.sum() * kLeastReduction < as_recorded.sum())) return std::nullopt;
    if ((aligned.array() > as_recorded.array()).any()) return std::nullopt;
    // Without a controller, or with little gain in the band, both are the same.
    const double of_actuators = misfit_of_u(samples);
    if (of_actuators * kClearly < aligned.sum()) return std::nullopt;
    return ExcitationDelay{samples, std::sqrt(as_recorded.sum() / std::max(1e-300, aligned.sum())),
                           of_actuators > kClearly * aligned.sum()};
  }

 private:
  std::complex<double> turned(int line, double samples) const {
    return std::polar(1.0, 2.0 * std::numbers::pi * line * samples / period_);
  }
  /// Misfit per experiment.
  Eigen::VectorXd misfit_of_r(int samples) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(experiments_);
    for (const Entry& at : entries_)
      sum[at.experiment] += std::norm(at.u - at.controlled - turned(at.line, samples));
    return sum;
  }

  double misfit_of_u(int samples) const {
    double sum = 0.0;
    for (const Entry& at : entries_)
      sum += std::norm(turned(at.line, -samples) * at.u - at.controlled - 1.0);
    return sum;
  }

  /// Shift with the largest cross-correlation.
  int best() const {
    RealDft dft(period_);
    Eigen::VectorXcd spectrum = Eigen::VectorXcd::Zero(dft.half_size());
    for (const Entry& at : entries_) {
      const std::complex<double> v = at.u - at.controlled;
      if (std::abs(v) > 0.0) spectrum[at.line] += std::conj(v) / std::abs(v);
    }
    const Eigen::VectorXd correlation = dft.inverse(spectrum);
    Index peak = 0;
    correlation.maxCoeff(&peak);
    return static_cast<int>(peak <= period_ / 2 ? peak : peak - period_);
  }

  int period_;
  Index experiments_;
  bool controller_known_ = false;
  std::vector<Entry> entries_;
};

}  // namespace

std::optional<ExcitationDelay> align_excitation(HealthRecord& record,
                                                const std::optional<NominalStage>& nominal) {
  if (record.frequency_hz.size() == 0 || record.axes.empty()) return std::nullopt;
  const std::optional<ExcitationDelay> delay = Alignment(record, nominal).find();
  if (!delay) return delay;
  const double late_s = delay->samples / record.info.sample_rate_hz;
  for (Index k = 0; k < record.frequency_hz.size(); ++k)
    record.lines[k].R *= std::polar(1.0, 2.0 * std::numbers::pi * record.frequency_hz[k] * late_s);
  return delay;
}

Finding to_finding(const ExcitationDelay& delay) {
  const std::string samples = counted(std::abs(delay.samples), "sample");
  const bool late = delay.samples > 0;
  return {Severity::doubt,
          Cause::excitation_timing,
          "excitation",
          delay.certain
              ? fmt::format("the excitation was recorded {} {}; the FRF is unaffected", samples,
                            late ? "late" : "early")
              : fmt::format("the excitation was recorded {} {} than all actuators; if only the "
                            "excitation is affected, the FRF is correct",
                            samples, late ? "later" : "earlier"),
          fmt::format("u matches it {:.2g} times better when shifted", delay.misfit),
          delay.certain
              ? "correct the time stamps of the excitation"
              : "give the stage file of this log (--stage), whose controller resolves this"};
}

}  // namespace stageid
