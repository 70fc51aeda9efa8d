#include "frf/run_spectra.hpp"

#include "frf/run_steps.hpp"

namespace stageid {
namespace {

/// Z_p of the period in workspace.samples.
void transform_period(const std::vector<int>& lines, const ChannelChoice& channels,
                      RunWorkspace& w) {
  const double scale = 1.0 / static_cast<double>(w.dft.length());
  Eigen::Index row = 0;
  const auto take = [&](const Eigen::MatrixXd& samples, Eigen::Index channel) {
    const auto spectrum = transform(samples, channel, w.dft);
    for (Eigen::Index k = 0; k < w.spectra.cols(); ++k) {
      w.spectra(row, k) =
          scale * spectrum[static_cast<std::size_t>(lines[static_cast<std::size_t>(k)])];
    }
    ++row;
  };
  for (const Eigen::Index sensor : channels.outputs) take(w.samples.sensors, sensor);
  for (const Eigen::Index actuator : channels.estimated) take(w.samples.actuators, actuator);
}

/// One more period into mean and scatter, by Welford's recursion: a difference of two large sums
/// would lose the noise, which is 1e-6 of the signal, in rounding; and this way the diagonal stays
/// >= 0.
void include_period(RunWorkspace& w, RunSpectra& run) {
  ++run.periods;
  const double inverse_count = 1.0 / run.periods;
  const double weight = 1.0 - inverse_count;
  for (Eigen::Index k = 0; k < run.mean.cols(); ++k) {
    for (Eigen::Index i = 0; i < run.mean.rows(); ++i) {
      const std::complex<double> deviation = w.spectra(i, k) - run.mean(i, k);
      run.mean(i, k) += deviation * inverse_count;
      w.deviation_re[i] = deviation.real();
      w.deviation_im[i] = deviation.imag();
    }
    if (run.periods < 2) continue;
    add_outer_product(weight, w.deviation_re, w.deviation_im, run.scatter_re.col(k).data(),
                      run.scatter_im.col(k).data());
  }
}

void prepare(std::size_t lines, const ChannelChoice& channels, int periods, RunWorkspace& w,
             RunSpectra& run) {
  const auto n_lines = static_cast<Eigen::Index>(lines);
  const auto n = static_cast<Eigen::Index>(channels.outputs.size() + channels.estimated.size());
  w.spectra.resize(n, n_lines);
  w.deviation_re.resize(n);
  w.deviation_im.resize(n);
  w.excluded_sum.setZero(w.dft.length(), static_cast<Eigen::Index>(channels.excluded.size()));
  run.mean.setZero(n, n_lines);
  if (periods < 2) return;
  run.scatter_re.setZero(n * (n + 1) / 2, n_lines);
  run.scatter_im.setZero(n * (n + 1) / 2, n_lines);
}

}  // namespace

RunSpectra measure_run(const UsedRun& used, const std::vector<int>& lines,
                       const ChannelChoice& channels, const Eigen::MatrixXd& excitation_period,
                       RunWorkspace& w, const std::function<void(double bytes)>& read_done) {
  RunSpectra run;
  prepare(lines.size(), channels, used.periods, w, run);
  Fingerprint fingerprint;
  add_matrix(fingerprint, excitation_period);

  const auto period = static_cast<std::uint64_t>(w.dft.length());
  for (int p = 0; p < used.periods; ++p) {
    const auto first = static_cast<std::uint64_t>(used.transient_periods + p) * period;
    used.log->read(used.index, first, period, w.samples);
    read_done(static_cast<double>(w.samples.actuators.size() + w.samples.sensors.size()) *
              sizeof(double));
    if ((w.samples.marked != 0).any()) continue;
    add_matrix(fingerprint, w.samples.actuators);
    add_matrix(fingerprint, w.samples.sensors);
    transform_period(lines, channels, w);
    include_period(w, run);
    for (std::size_t c = 0; c < channels.excluded.size(); ++c) {
      w.excluded_sum.col(static_cast<Eigen::Index>(c)) +=
          w.samples.actuators.col(channels.excluded[c]);
    }
  }
  if (run.periods == 0) refuse_marked_run(used);
  run.scatter_dof = run.periods - 1;
  run.excluded_power = excluded_power(lines, run.periods, w);
  run.fingerprint = fingerprint.hex();
  return run;
}

}  // namespace stageid
