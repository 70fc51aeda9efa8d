#include "frf/record_spectra.hpp"

#include <algorithm>

#include "frf/run_steps.hpp"
#include "frf/transient_model.hpp"

namespace stageid {
namespace {

/// The chosen channels of a run, samples x channels, and which periods are clean.
struct Record {
  Eigen::MatrixXd samples;  ///< outputs, estimated, excluded
  std::vector<char> clean;  ///< a value a period
};

/// Half open, in periods.
struct Stretch {
  int first = 0;
  int periods = 0;
};

Stretch longest_clean(const std::vector<char>& clean) {
  Stretch longest;
  Stretch current;
  for (int p = 0; p < static_cast<int>(clean.size()); ++p) {
    if (clean[static_cast<std::size_t>(p)] == 0) {
      current = {p + 1, 0};
    } else if (++current.periods > longest.periods) {
      longest = current;
    }
  }
  return longest;
}

Record read_record(const UsedRun& used, const ChannelChoice& channels, RunWorkspace& w,
                   const std::function<void(double bytes)>& read_done) {
  const Eigen::Index N = w.dft.length();
  const std::size_t n = channels.outputs.size() + channels.estimated.size();
  Record record;
  record.samples.resize(N * used.periods, static_cast<Eigen::Index>(n + channels.excluded.size()));
  for (int p = 0; p < used.periods; ++p) {
    const auto first = static_cast<std::uint64_t>((used.transient_periods + p) * N);
    used.log->read(used.index, first, static_cast<std::uint64_t>(N), w.samples);
    read_done(static_cast<double>(w.samples.actuators.size() + w.samples.sensors.size()) *
              sizeof(double));
    record.clean.push_back((w.samples.marked != 0).any() ? 0 : 1);
    Eigen::Index column = 0;
    const auto take = [&](const Eigen::MatrixXd& samples, const std::vector<Eigen::Index>& which) {
      for (const Eigen::Index c : which) {
        record.samples.col(column++).segment(p * N, N) = samples.col(c);
      }
    };
    take(w.samples.sensors, channels.outputs);
    take(w.samples.actuators, channels.estimated);
    take(w.samples.actuators, channels.excluded);
  }
  return record;
}

/// DFT / samples of the first `channels` columns, channels x bins.
Eigen::MatrixXcd record_spectrum(const Eigen::MatrixXd& samples, Eigen::Index channels,
                                 Eigen::Index bins, RealDft& dft) {
  Eigen::MatrixXcd Z(channels, bins);
  const double scale = 1.0 / static_cast<double>(dft.length());
  for (Eigen::Index c = 0; c < channels; ++c) {
    const auto spectrum = transform(samples, c, dft);
    for (Eigen::Index b = 0; b < bins; ++b) Z(c, b) = scale * spectrum[static_cast<std::size_t>(b)];
  }
  return Z;
}

}  // namespace

RunSpectra measure_record(const UsedRun& used, const ExcitationSpectrum& excitation,
                          const ChannelChoice& channels, const Eigen::MatrixXd& excitation_period,
                          RunWorkspace& w, const std::function<void(double bytes)>& read_done) {
  Record record = read_record(used, channels, w, read_done);
  const Stretch stretch = longest_clean(record.clean);
  if (stretch.periods == 0) refuse_marked_run(used);
  const Eigen::Index N = w.dft.length();
  record.samples = record.samples.middleRows(stretch.first * N, stretch.periods * N).eval();

  RunSpectra run;
  run.periods = stretch.periods;
  Fingerprint fingerprint;
  add_matrix(fingerprint, excitation_period);
  add_matrix(fingerprint, record.samples);
  run.fingerprint = fingerprint.hex();

  const auto outputs = static_cast<Eigen::Index>(channels.outputs.size());
  const Eigen::Index n = outputs + static_cast<Eigen::Index>(channels.estimated.size());
  const TransientModel model(static_cast<int>(N), stretch.periods, excitation, outputs,
                             used.place());
  RealDft dft(static_cast<int>(record.samples.rows()));
  model.separate(record_spectrum(record.samples, n, model.bins(), dft), run);

  w.excluded_sum.setZero(N, record.samples.cols() - n);
  for (int p = 0; p < stretch.periods; ++p) {
    w.excluded_sum += record.samples.rightCols(record.samples.cols() - n).middleRows(p * N, N);
  }
  run.excluded_power = excluded_power(excitation.lines, stretch.periods, w);
  return run;
}

}  // namespace stageid
