#include "estimation/modal/prediction_error.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <stdexcept>

#include "excitation/multisine/dft.hpp"

namespace stageid {
namespace {

std::vector<Eigen::Index> indices_of(const std::vector<std::string>& wanted,
                                     const ChannelList& there, const LogReader& log) {
  std::vector<Eigen::Index> indices;
  for (const std::string& name : wanted) {
    const auto found = std::find(there.names.begin(), there.names.end(), name);
    if (found == there.names.end())
      throw std::invalid_argument(
          fmt::format("{}: has no channel '{}', which the model needs; use a log with all channels "
                      "of the model",
                      log.path().string(), name));
    indices.push_back(found - there.names.begin());
  }
  return indices;
}

class Predictor {
 public:
  Predictor(const AdditiveModel& model, const LogReader& log, double low_hz, double high_hz)
      : log_(log),
        dft_(log.info().period_samples),
        inputs_(indices_of(model.inputs.names, log.info().actuators, log)),
        outputs_(indices_of(model.outputs.names, log.info().sensors, log)) {
    const double resolution_hz = log.info().sample_rate_hz / log.info().period_samples;
    const double nyquist_hz = 0.5 * log.info().sample_rate_hz;
    first_ = std::max(1L, static_cast<long>(std::ceil(low_hz / resolution_hz - 1e-9)));
    const long last = static_cast<long>(
        std::floor(std::min(high_hz, nyquist_hz * (1.0 - 1e-9)) / resolution_hz + 1e-9));
    if (last < first_)
      throw std::invalid_argument(
          fmt::format("{}: has no line between {} and {} Hz; use another --band",
                      log.path().string(), low_hz, high_hz));
    const Eigen::VectorXd frequency_hz =
        Eigen::VectorXd::LinSpaced(last - first_ + 1, static_cast<double>(first_),
                                   static_cast<double>(last)) *
        resolution_hz;
    // A model without hold was fitted to compensated data; a log still contains the hold.
    response_ = response(model, frequency_hz,
                         model.hold == HoldModel::none ? HoldModel::exact : model.hold);
    result_.sensors = model.outputs.names;
    result_.band_hz[0] = frequency_hz[0];
    result_.band_hz[1] = frequency_hz[frequency_hz.size() - 1];
    result_.error_rms = Eigen::VectorXd::Zero(model.n_outputs());
    result_.signal_rms = Eigen::VectorXd::Zero(model.n_outputs());
  }

  PredictionError predict() {
    double periods = 0.0;
    for (std::size_t run = 0; run < log_.runs().size(); ++run) {
      if (!log_.runs()[run].complete) continue;
      periods += add_run(run);
      ++result_.runs;
    }
    if (periods == 0.0)
      throw std::invalid_argument(
          fmt::format("{}: no complete run has a measured period; use a log with a complete run",
                      log_.path().string()));
    result_.error_rms = (result_.error_rms / periods).cwiseSqrt();
    result_.signal_rms = (result_.signal_rms / periods).cwiseSqrt();
    return std::move(result_);
  }

 private:
  /// Number of periods used; those with a marked sample are skipped.
  double add_run(std::size_t run) {
    const auto N = static_cast<std::uint64_t>(log_.info().period_samples);
    const auto skip = static_cast<std::uint64_t>(log_.info().transient_periods);
    double used = 0.0;
    for (std::uint64_t p = skip; (p + 1) * N <= log_.runs()[run].samples; ++p) {
      log_.read(run, p * N, N, samples_);
      if (samples_.marked.size() > 0 && samples_.marked.any()) continue;
      add_period();
      used += 1.0;
    }
    return used;
  }

  void add_period() {
    const Eigen::Index lines = response_.cols();
    const auto n_y = static_cast<Eigen::Index>(outputs_.size());
    Eigen::MatrixXcd predicted = Eigen::MatrixXcd::Zero(n_y, lines);
    for (std::size_t j = 0; j < inputs_.size(); ++j) {
      const Eigen::RowVectorXcd U = spectrum(samples_.actuators.col(inputs_[j]));
      predicted.array() +=
          response_.middleRows(static_cast<Eigen::Index>(j) * n_y, n_y).array().rowwise() *
          U.array();
    }
    for (Eigen::Index i = 0; i < n_y; ++i) {
      const Eigen::RowVectorXcd Y =
          spectrum(samples_.sensors.col(outputs_[static_cast<std::size_t>(i)]));
      // Parseval: a line l of DFT / N and its conjugate contribute 2 |.|^2 to the mean square.
      result_.error_rms[i] += 2.0 * (Y - predicted.row(i)).squaredNorm();
      result_.signal_rms[i] += 2.0 * Y.squaredNorm();
    }
  }

  Eigen::RowVectorXcd spectrum(const Eigen::Ref<const Eigen::VectorXd>& x) {
    std::copy(x.begin(), x.end(), dft_.input().begin());
    const std::span<const std::complex<double>> X = dft_.forward();
    const Eigen::Map<const Eigen::RowVectorXcd> all(X.data(), static_cast<Eigen::Index>(X.size()));
    return all.segment(first_, response_.cols()) / static_cast<double>(dft_.length());
  }

  const LogReader& log_;
  RealDft dft_;
  std::vector<Eigen::Index> inputs_;
  std::vector<Eigen::Index> outputs_;
  long first_ = 1;
  Eigen::MatrixXcd response_;
  LogSamples samples_;
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
