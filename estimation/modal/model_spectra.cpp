#include "estimation/modal/model_spectra.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

std::vector<Eigen::Index> indices_of(const std::vector<std::string>& wanted,
                                     const ChannelList& there, const LogReader& log) {
  std::vector<Eigen::Index> indices;
  for (const std::string& name : wanted) {
    const auto found = std::ranges::find(there.names, name);
    if (found == there.names.end())
      fail_request(
          "{}: has no channel '{}', which the model needs; use a log with all channels "
          "of the model",
          log.path().string(), name);
    indices.push_back(found - there.names.begin());
  }
  return indices;
}

}  // namespace

std::vector<int> lines_in_band(const LogInfo& info, double low_hz, double high_hz) {
  const double resolution_hz = info.sample_rate_hz / info.period_samples;
  const double nyquist_hz = 0.5 * info.sample_rate_hz;
  const int first = std::max(1, static_cast<int>(std::ceil(low_hz / resolution_hz - 1e-9)));
  const int last = static_cast<int>(
      std::floor(std::min(high_hz, nyquist_hz * (1.0 - 1e-9)) / resolution_hz + 1e-9));
  std::vector<int> lines;
  for (int l = first; l <= last; ++l) lines.push_back(l);
  return lines;
}

ModelSpectra::ModelSpectra(const AdditiveModel& model, const LogReader& log, std::vector<int> lines)
    : dft_(log.info().period_samples),
      lines_(std::move(lines)),
      inputs_(indices_of(model.inputs.names, log.info().actuators, log)),
      outputs_(indices_of(model.outputs.names, log.info().sensors, log)) {}

std::optional<PeriodSpectra> ModelSpectra::read(const LogReader& log, std::size_t run,
                                                std::uint64_t period) {
  const auto N = static_cast<std::uint64_t>(dft_.length());
  log.read(run, period * N, N, samples_);
  if (samples_.marked.size() > 0 && samples_.marked.any()) return std::nullopt;
  return PeriodSpectra{spectra(samples_.sensors, outputs_), spectra(samples_.actuators, inputs_)};
}

Eigen::MatrixXcd ModelSpectra::spectra(const Eigen::MatrixXd& samples,
                                       const std::vector<Eigen::Index>& channels) {
  Eigen::MatrixXcd out(std::ssize(channels), std::ssize(lines_));
  for (Eigen::Index c = 0; c < out.rows(); ++c) {
    const auto X = dft_.forward(samples.col(channels[c]));
    for (Eigen::Index k = 0; k < out.cols(); ++k) out(c, k) = X[lines_[k]];
  }
  return out / static_cast<double>(dft_.length());
}

}  // namespace stageid
