#include "frf/health_record.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <numeric>
#include <set>

#include "frf/excitation_spectrum.hpp"
#include "frf/run_steps.hpp"
#include "frf/run_table.hpp"
#include "frf/worker_pool.hpp"

namespace stageid {
namespace {

/// What one run gives.
struct RunPart {
  std::vector<Eigen::MatrixXcd> periods;  // Z on the lines, channels x K; empty: not asked for
  std::vector<ChannelScan> scan;
};

/// At most `most` of the lines: half of them in equal ratios, for the rigid body, half in equal steps, for
/// the flexible modes.
std::vector<int> thinned(const std::vector<int>& lines, Eigen::Index most) {
  if (static_cast<Eigen::Index>(lines.size()) <= most) return lines;
  std::set<int> chosen;
  const auto half = static_cast<int>(most / 2);
  const double first = lines.front();
  const double last = lines.back();
  for (int i = 0; i < half; ++i) {
    const double share = static_cast<double>(i) / (half - 1);
    for (const double wanted :
         {first * std::pow(last / first, share), first + share * (last - first)}) {
      const auto at =
          std::lower_bound(lines.begin(), lines.end(), static_cast<int>(std::lround(wanted)));
      chosen.insert(at == lines.end() ? lines.back() : *at);
    }
  }
  return {chosen.begin(), chosen.end()};
}

Eigen::MatrixXcd period_spectra(const std::vector<int>& lines, RunWorkspace& w) {
  const LogSamples& s = w.samples;
  Eigen::MatrixXcd Z(s.sensors.cols() + s.actuators.cols(),
                     static_cast<Eigen::Index>(lines.size()));
  for (Eigen::Index c = 0; c < Z.rows(); ++c) {
    const bool sensor = c < s.sensors.cols();
    const auto spectrum =
        transform(sensor ? s.sensors : s.actuators, sensor ? c : c - s.sensors.cols(), w.dft);
    for (Eigen::Index k = 0; k < Z.cols(); ++k)
      Z(c, k) = spectrum[static_cast<std::size_t>(lines[static_cast<std::size_t>(k)])] /
                static_cast<double>(w.dft.length());
  }
  return Z;
}

void scan_period(const LogSamples& s, std::vector<ChannelScan>& scan) {
  for (Eigen::Index c = 0; c < s.sensors.cols(); ++c)
    scan[static_cast<std::size_t>(c)].add(s.sensors.col(c));
  for (Eigen::Index c = 0; c < s.actuators.cols(); ++c)
    scan[static_cast<std::size_t>(s.sensors.cols() + c)].add(s.actuators.col(c));
}

RunPart read_run(const UsedRun& used, const std::vector<int>& lines, RunWorkspace& w,
                 const std::function<void(double)>& read_done) {
  const LogInfo& info = used.log->info();
  RunPart part;
  part.scan.resize(info.sensors.size() + info.actuators.size());
  const auto period = static_cast<std::uint64_t>(w.dft.length());
  bool clean = false;
  for (int p = 0; p < used.periods; ++p) {
    used.log->read(used.index, static_cast<std::uint64_t>(used.transient_periods + p) * period,
                   period, w.samples);
    read_done(static_cast<double>(w.samples.actuators.size() + w.samples.sensors.size()) *
              sizeof(double));
    if ((w.samples.marked != 0).any()) {
      for (ChannelScan& channel : part.scan) channel.break_off();
      continue;
    }
    clean = true;
    scan_period(w.samples, part.scan);
    if (!lines.empty()) part.periods.push_back(period_spectra(lines, w));
  }
  if (!clean) refuse_marked_run(used);
  return part;
}

/// The work on one set of logs.
class RecordReading {
 public:
  RecordReading(const std::vector<const LogReader*>& logs, const FrfOptions& options)
      : options_(options), realizations_(choose_runs(logs, options)) {
    for (const RealizationRuns& realization : realizations_)
      runs_.insert(runs_.end(), realization.runs.begin(), realization.runs.end());
    const LogInfo& info = runs_.front().log->info();
    record_.info = info;
    record_.realization = realizations_.front().realization;
    workers_ = static_cast<int>(
        std::min(static_cast<std::size_t>(worker_count(options.threads)), runs_.size()));
    for (int w = 0; w < workers_; ++w)
      workspaces_.push_back(std::make_unique<RunWorkspace>(info.period_samples));
    for (const UsedRun& used : runs_)
      total_ += static_cast<double>(used.periods) * info.period_samples *
                static_cast<double>(info.actuators.size() + info.sensors.size()) * sizeof(double);
  }

  HealthRecord read(Eigen::Index most_lines);

 private:
  void read_excitation(Eigen::Index most_lines);
  void read_samples();
  void add(RunPart&& part, std::size_t run);

  const FrfOptions& options_;
  std::vector<RealizationRuns> realizations_;
  std::vector<UsedRun> runs_;  // those of the first realization first
  int workers_ = 1;
  std::vector<std::unique_ptr<RunWorkspace>> workspaces_;
  std::vector<int> lines_;
  std::mutex mutex_;
  double done_ = 0.0;
  double total_ = 0.0;
  HealthRecord record_;
};

void RecordReading::read_excitation(Eigen::Index most_lines) {
  const std::vector<UsedRun>& runs = realizations_.front().runs;
  std::vector<ExcitationSpectrum> spectra(runs.size());
  std::vector<Eigen::MatrixXd> periods(runs.size());
  for (std::size_t e = 0; e < runs.size(); ++e) {
    periods[e] = runs[e].log->excitation(runs[e].index);
    if (periods[e].rows() != record_.info.period_samples)
      throw std::invalid_argument(runs[e].place() +
                                  "/excitation: is not one period; one period of "
                                  "period_samples rows belongs there");
    spectra[e] = excitation_spectrum(periods[e], workspaces_.front()->dft);
    record_.axes.insert(record_.axes.end(), spectra[e].channels.begin(), spectra[e].channels.end());
  }
  std::sort(record_.axes.begin(), record_.axes.end());
  record_.axes.erase(std::unique(record_.axes.begin(), record_.axes.end()), record_.axes.end());
  lines_ = thinned(spectra.front().lines, most_lines);
  const auto K = static_cast<Eigen::Index>(lines_.size());
  record_.frequency_hz.resize(K);
  record_.lines.resize(lines_.size());
  for (Eigen::Index k = 0; k < K; ++k) {
    const int line = lines_[static_cast<std::size_t>(k)];
    record_.frequency_hz[k] = line * record_.info.sample_rate_hz / record_.info.period_samples;
    LineRecord& at = record_.lines[static_cast<std::size_t>(k)];
    at.R.setZero(static_cast<Eigen::Index>(record_.info.excitation.size()),
                 static_cast<Eigen::Index>(runs.size()));
    for (std::size_t e = 0; e < runs.size(); ++e) {
      const auto found = std::lower_bound(spectra[e].lines.begin(), spectra[e].lines.end(), line);
      if (found != spectra[e].lines.end() && *found == line)
        at.R.col(static_cast<Eigen::Index>(e)) =
            spectra[e].values.col(found - spectra[e].lines.begin());
    }
  }
}

void RecordReading::add(RunPart&& part, std::size_t run) {
  for (std::size_t c = 0; c < part.scan.size(); ++c) record_.scan[c].add(part.scan[c]);
  record_.health += runs_[run].run().health;
  if (part.periods.empty()) return;
  record_.periods.push_back(static_cast<int>(part.periods.size()));
  for (std::size_t k = 0; k < lines_.size(); ++k) {
    Eigen::MatrixXcd& Z = record_.lines[k].Z;
    const Eigen::Index first = Z.cols();
    Z.conservativeResize(part.periods.front().rows(),
                         first + static_cast<Eigen::Index>(part.periods.size()));
    for (std::size_t p = 0; p < part.periods.size(); ++p)
      Z.col(first + static_cast<Eigen::Index>(p)) =
          part.periods[p].col(static_cast<Eigen::Index>(k));
  }
}

void RecordReading::read_samples() {
  record_.scan.resize(record_.info.sensors.size() + record_.info.actuators.size());
  const auto read_done = [this](double bytes) {
    if (!options_.progress) return;
    const std::lock_guard lock(mutex_);
    options_.progress(done_ += bytes, total_);
  };
  const std::size_t with_spectra = lines_.empty() ? 0 : realizations_.front().runs.size();
  std::vector<RunPart> parts(runs_.size());
  for_each_task(workers_, runs_.size(), [&](int worker, std::size_t i) {
    parts[i] = read_run(runs_[i], i < with_spectra ? lines_ : std::vector<int>{},
                        *workspaces_[static_cast<std::size_t>(worker)], read_done);
  });
  for (std::size_t i = 0; i < parts.size(); ++i) add(std::move(parts[i]), i);
}

HealthRecord RecordReading::read(Eigen::Index most_lines) {
  read_excitation(most_lines);
  read_samples();
  return std::move(record_);
}

}  // namespace

int HealthRecord::scatter_dof() const noexcept {
  return std::accumulate(periods.begin(), periods.end(), 0) - static_cast<int>(periods.size());
}

Eigen::MatrixXcd HealthRecord::mean(const Eigen::MatrixXcd& columns) const {
  Eigen::MatrixXcd means(columns.rows(), experiments());
  Eigen::Index first = 0;
  for (Eigen::Index e = 0; e < experiments(); ++e) {
    const Eigen::Index P = periods[static_cast<std::size_t>(e)];
    means.col(e) = columns.middleCols(first, P).rowwise().mean();
    first += P;
  }
  return means;
}

Eigen::MatrixXcd HealthRecord::scatter(const Eigen::MatrixXcd& columns) const {
  Eigen::MatrixXcd deviation = columns;
  const Eigen::MatrixXcd means = mean(columns);
  Eigen::Index first = 0;
  for (Eigen::Index e = 0; e < experiments(); ++e) {
    const Eigen::Index P = periods[static_cast<std::size_t>(e)];
    deviation.middleCols(first, P).colwise() -= means.col(e);
    first += P;
  }
  return deviation * deviation.adjoint();
}

Eigen::VectorXd HealthRecord::variance_of_mean(const Eigen::MatrixXcd& columns) const {
  double mean_of_periods = 0.0;
  for (const int P : periods) mean_of_periods += 1.0 / P / static_cast<double>(experiments());
  return scatter(columns).diagonal().real() * (mean_of_periods / std::max(1, scatter_dof()));
}

HealthRecord read_health_record(const std::vector<const LogReader*>& logs,
                                const FrfOptions& options, Eigen::Index most_lines) {
  RecordReading reading(logs, options);
  return reading.read(most_lines);
}

}  // namespace stageid
