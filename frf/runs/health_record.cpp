#include "frf/runs/health_record.hpp"

#include <algorithm>
#include <numeric>

#include "frf/runs/byte_counter.hpp"
#include "frf/runs/health_gathering.hpp"
#include "frf/runs/run_steps.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {
namespace {

std::size_t total_runs(const std::vector<RealizationRuns>& realizations) {
  std::size_t runs = 0;
  for (const RealizationRuns& realization : realizations) runs += realization.runs.size();
  return runs;
}

/// Reads one set of logs.
class RecordReading {
 public:
  RecordReading(const std::vector<const LogReader*>& logs, const FrfOptions& options)
      : realizations_(choose_runs(logs, options).realizations),
        bytes_(options, realizations_),
        gathering_(realizations_),
        watch_start_(options.method == FrfMethod::periodic),
        sensors_(first_indices(std::ssize(realizations_.front().runs.front().log->info().sensors))),
        workers_(options.threads, total_runs(realizations_),
                 realizations_.front().runs.front().log->info().period_samples) {}

  HealthRecord read() {
    const UsedRun* marked = nullptr;
    std::size_t m = 0;
    while (!gathering_.complete()) {
      if (m == realizations_.size()) refuse_marked_runs(*marked);
      const std::vector<UsedRun>& runs = realizations_[m].runs;
      read_excitation(m);
      read_runs(m, m + 1);
      const std::size_t e = gathering_.first_without_spectra();
      if (marked == nullptr && e < runs.size()) marked = &runs[e];
      ++m;
    }
    for (std::size_t other = m; other < realizations_.size(); ++other) read_excitation(other);
    read_runs(m, realizations_.size());
    return gathering_.finish();
  }

 private:
  struct Run {
    const UsedRun* used;
    HealthPart* part;
  };

  /// Reads the runs of realizations first ... last - 1 in parallel.
  void read_runs(std::size_t first, std::size_t last) {
    std::vector<Run> runs;
    for (std::size_t m = first; m < last; ++m)
      for (std::size_t e = 0; e < realizations_[m].runs.size(); ++e)
        runs.push_back({&realizations_[m].runs[e], &gathering_.part(m, e)});
    workers_.for_each(runs.size(), [&](RunWorkspace& w, std::size_t i) { read_run(runs[i], w); });
  }

  void read_excitation(std::size_t realization) {
    gathering_.excite(realization,
                      workers_.read_excitation(realizations_[realization].runs, false));
  }

  void read_run(const Run& run, RunWorkspace& w) {
    const RunExcitation excitation = read_run_excitation(*run.used, w.dft);
    if (watch_start_) run.part->watch_start(*run.used, excitation.spectrum.lines, sensors_, w);
    read_periods(
        *run.used, excitation.period, w, run.part, [this](double bytes) { bytes_.add(bytes); },
        [](int) { return nullptr; }, [](int, const std::string&) {});
  }

  std::vector<RealizationRuns> realizations_;
  ByteCounter bytes_;
  HealthGathering gathering_;
  bool watch_start_;  // lpm models the transient
  std::vector<Eigen::Index> sensors_;
  RunWorkers workers_;
};

}  // namespace

int RealizationRecord::scatter_dof() const noexcept {
  return std::accumulate(periods.begin(), periods.end(), 0) - static_cast<int>(periods.size());
}

Eigen::MatrixXcd RealizationRecord::mean(const Eigen::MatrixXcd& columns) const {
  Eigen::MatrixXcd means(columns.rows(), experiments());
  Eigen::Index first = 0;
  for (Eigen::Index e = 0; e < experiments(); ++e) {
    const Eigen::Index P = periods[e];
    means.col(e) = columns.middleCols(first, P).rowwise().mean();
    first += P;
  }
  return means;
}

Eigen::MatrixXcd RealizationRecord::scatter(const Eigen::MatrixXcd& columns) const {
  Eigen::MatrixXcd deviation = columns;
  const Eigen::MatrixXcd means = mean(columns);
  Eigen::Index first = 0;
  for (Eigen::Index e = 0; e < experiments(); ++e) {
    const Eigen::Index P = periods[e];
    deviation.middleCols(first, P).colwise() -= means.col(e);
    first += P;
  }
  return deviation * deviation.adjoint();
}

Eigen::VectorXd RealizationRecord::variance_of_mean(const Eigen::MatrixXcd& columns) const {
  double mean_of_periods = 0.0;
  for (const int P : periods) mean_of_periods += 1.0 / P / static_cast<double>(experiments());
  return scatter(columns).diagonal().real() * (mean_of_periods / std::max(1, scatter_dof()));
}

HealthRecord read_health_record(const std::vector<const LogReader*>& logs,
                                const FrfOptions& options) {
  RecordReading reading(logs, options);
  return reading.read();
}

}  // namespace stageid
