#include "estimation/modal/prediction_error.hpp"

#include <cmath>
#include <optional>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "estimation/modal/model_spectra.hpp"

namespace stageid {
namespace {

class Predictor {
 public:
  Predictor(const AdditiveModel& model, const LogReader& log, double low_hz, double high_hz)
      : Predictor(model, log, lines_of(log, low_hz, high_hz)) {}

  PredictionError predict() {
    double periods = 0.0;
    for (std::size_t run = 0; run < log_.runs().size(); ++run) {
      if (!log_.runs()[run].complete) continue;
      periods += add_run(run);
      ++result_.runs;
    }
    if (periods == 0.0)
      fail_request("{}: no complete run has a measured period; use a log with a complete run",
                   log_.path().string());
    result_.error_rms = (result_.error_rms / periods).cwiseSqrt();
    result_.signal_rms = (result_.signal_rms / periods).cwiseSqrt();
    return std::move(result_);
  }

 private:
  static std::vector<int> lines_of(const LogReader& log, double low_hz, double high_hz) {
    std::vector<int> lines = lines_in_band(log.info(), low_hz, high_hz);
    if (lines.empty())
      fail_request("{}: has no line between {} and {} Hz; use another --band", log.path().string(),
                   low_hz, high_hz);
    return lines;
  }

  Predictor(const AdditiveModel& model, const LogReader& log, const std::vector<int>& lines)
      : log_(log), spectra_(model, log, lines) {
    const double resolution_hz = log.info().sample_rate_hz / log.info().period_samples;
    const Eigen::VectorXd frequency_hz =
        Eigen::VectorXi::Map(lines.data(), std::ssize(lines)).cast<double>() * resolution_hz;
    // A model without hold was fitted to compensated data; a log still contains the hold.
    response_ = response(model, frequency_hz,
                         model.hold == HoldModel::none ? HoldModel::exact : model.hold);
    result_.sensors = model.outputs.names;
    result_.band_hz[0] = frequency_hz[0];
    result_.band_hz[1] = frequency_hz[frequency_hz.size() - 1];
    result_.error_rms = Eigen::VectorXd::Zero(model.n_outputs());
    result_.signal_rms = Eigen::VectorXd::Zero(model.n_outputs());
  }

  /// Number of periods used; those with a marked sample are skipped.
  double add_run(std::size_t run) {
    const auto N = static_cast<std::uint64_t>(log_.info().period_samples);
    double used = 0.0;
    for (auto p = static_cast<std::uint64_t>(log_.info().transient_periods);
         (p + 1) * N <= log_.runs()[run].samples; ++p) {
      const std::optional<PeriodSpectra> period = spectra_.read(log_, run, p);
      if (!period) continue;
      add_period(*period);
      used += 1.0;
    }
    return used;
  }

  void add_period(const PeriodSpectra& period) {
    const Eigen::Index n_y = period.Y.rows();
    Eigen::MatrixXcd predicted = Eigen::MatrixXcd::Zero(n_y, period.Y.cols());
    for (Eigen::Index j = 0; j < period.U.rows(); ++j)
      predicted.array() +=
          response_.middleRows(j * n_y, n_y).array().rowwise() * period.U.row(j).array();
    // Parseval: a line l of DFT / N and its conjugate contribute 2 |.|^2 to the mean square.
    result_.error_rms += 2.0 * (period.Y - predicted).rowwise().squaredNorm();
    result_.signal_rms += 2.0 * period.Y.rowwise().squaredNorm();
  }

  const LogReader& log_;
  ModelSpectra spectra_;
  Eigen::MatrixXcd response_;
  PredictionError result_;
};

}  // namespace

double PredictionError::normalized() const {
  const Eigen::ArrayXd ratio = error_rms.array() / signal_rms.array();
  return std::sqrt(ratio.square().mean());
}

PredictionError prediction_error(const AdditiveModel& model, const LogReader& log, double low_hz,
                                 double high_hz) {
  return Predictor(model, log, low_hz, high_hz).predict();
}

}  // namespace stageid
