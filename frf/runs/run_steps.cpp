#include "frf/runs/run_steps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <complex>
#include <set>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_error.hpp"
#include "excitation/multisine/frequency_grid.hpp"
#include "excitation/threads/worker_pool.hpp"

namespace stageid {
namespace {

/// Unscaled DFT of one channel; valid until the next call.
std::span<const std::complex<double>> transform(const Eigen::Ref<const Eigen::VectorXd>& samples,
                                                RealDft& dft) {
  const auto input = dft.input();
  if (samples.size() > 0 && (samples.array() == samples[0]).all())
    std::fill_n(input.begin(), samples.size(), 0.0);
  else
    std::copy_n(samples.data(), samples.size(), input.begin());
  return dft.forward();
}

}  // namespace

RunExcitation read_run_excitation(const UsedRun& run, RealDft& dft) {
  RunExcitation excitation{run.log->excitation(run.index), {}};
  if (excitation.period.rows() != dft.length())
    fail_request("{}/excitation: {} samples; expected one period of {}", run.place(),
                 excitation.period.rows(), dft.length());
  excitation.spectrum = excitation_spectrum(excitation.period, dft);
  return excitation;
}

std::vector<Eigen::Index> excited_axes(const std::vector<RunExcitation>& runs) {
  std::set<Eigen::Index> axes;
  for (const RunExcitation& run : runs)
    axes.insert(run.spectrum.channels.begin(), run.spectrum.channels.end());
  return {axes.begin(), axes.end()};
}

Eigen::VectorXd frequencies_hz(const LogInfo& info, const std::vector<int>& lines) {
  if (lines.empty()) return {};
  return FrequencyGrid(info.sample_rate_hz, info.period_samples, lines).frequency_hz();
}

RunWorkers::RunWorkers(int threads, std::size_t runs, int period_samples) {
  const auto workers = std::min(static_cast<std::size_t>(worker_count(threads)), runs);
  for (std::size_t w = 0; w < workers; ++w)
    workspaces_.push_back(std::make_unique<RunWorkspace>(period_samples, pool_));
}

void RunWorkers::for_each(std::size_t count,
                          const std::function<void(RunWorkspace&, std::size_t)>& work) {
  for_each_task(static_cast<int>(workspaces_.size()), count,
                [&](int worker, std::size_t i) { work(*workspaces_[worker], i); });
}

std::vector<RunExcitation> RunWorkers::read_excitation(const std::vector<UsedRun>& runs,
                                                       bool keep_periods) {
  std::vector<RunExcitation> excitation(runs.size());
  for_each(runs.size(), [&](RunWorkspace& workspace, std::size_t e) {
    excitation[e] = read_run_excitation(runs[e], workspace.dft);
    if (!keep_periods) excitation[e].period.resize(0, 0);
  });
  return excitation;
}

// Spectra are stored line by line, so consecutive lines of one channel are far apart. Writing four channels at a time
// fills a cache line.
void line_spectra(const Eigen::Ref<const Eigen::MatrixXd>& samples,
                  const std::vector<Eigen::Index>& channels, const std::vector<int>& lines,
                  Eigen::Index first_row, RealDft& dft, Eigen::MatrixXcd& spectra) {
  constexpr Eigen::Index kTogether = 4;
  const double scale = 1.0 / static_cast<double>(dft.length());
  const auto count = std::ssize(channels);
  Eigen::MatrixXcd some(spectra.cols(), kTogether);
  for (Eigen::Index first = 0; first < count; first += kTogether) {
    const Eigen::Index n = std::min(kTogether, count - first);
    for (Eigen::Index c = 0; c < n; ++c) {
      const auto spectrum = transform(samples.col(channels[first + c]), dft);
      for (Eigen::Index k = 0; k < some.rows(); ++k) some(k, c) = scale * spectrum[lines[k]];
    }
    for (Eigen::Index k = 0; k < some.rows(); ++k)
      for (Eigen::Index c = 0; c < n; ++c) spectra(first_row + first + c, k) = some(k, c);
  }
}

void add_outer_product(double weight, const Eigen::VectorXd& re, const Eigen::VectorXd& im,
                       double* packed_re, double* packed_im) {
  for (Eigen::Index i = 0; i < re.size(); ++i) {
    const double a = weight * re[i];
    const double b = weight * im[i];
    for (Eigen::Index j = 0; j <= i; ++j) {
      packed_re[j] += a * re[j] + b * im[j];
      packed_im[j] += b * re[j] - a * im[j];
    }
    packed_re += i + 1;
    packed_im += i + 1;
  }
}

Eigen::VectorXd excluded_power(const std::vector<int>& lines, int periods, RunWorkspace& w) {
  const double scale = 1.0 / (static_cast<double>(w.dft.length()) * periods);
  Eigen::VectorXd power = Eigen::VectorXd::Zero(w.excluded_sum.cols());
  for (Eigen::Index c = 0; c < power.size(); ++c) {
    const auto spectrum = transform(w.excluded_sum.col(c), w.dft);
    for (const int line : lines) power[c] += std::norm(scale * spectrum[line]);
  }
  return power;
}

std::string no_clean_period(const UsedRun& run) {
  return fmt::format("each of its {} periods after the transient has a marked sample", run.periods);
}

void refuse_marked_runs(const UsedRun& run) {
  throw FormatError(run.log->path(), fmt::format("/runs/{}", run.run().name),
                    no_clean_period(run) + ", and every realization has such a run; measure again");
}

}  // namespace stageid
