#include "frf/runs/health_record.hpp"

#include <algorithm>
#include <memory>
#include <numeric>

#include "excitation/threads/worker_pool.hpp"
#include "frf/runs/byte_counter.hpp"
#include "frf/runs/health_gathering.hpp"
#include "frf/runs/run_periods.hpp"
#include "frf/runs/run_steps.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {
namespace {

/// Reads one set of logs.
class RecordReading {
 public:
  RecordReading(const std::vector<const LogReader*>& logs, const FrfOptions& options)
      : realizations_(choose_runs(logs, options).realizations),
        bytes_(options, realizations_),
        gathering_(realizations_),
        watch_start_(options.method == FrfMethod::periodic),
        sensors_(realizations_.front().runs.front().log->info().sensors.size()) {
    std::iota(sensors_.begin(), sensors_.end(), 0);
    std::size_t runs = 0;
    for (const RealizationRuns& realization : realizations_) runs += realization.runs.size();
    const int period = realizations_.front().runs.front().log->info().period_samples;
    workers_ =
        static_cast<int>(std::min(static_cast<std::size_t>(worker_count(options.threads)), runs));
    for (int w = 0; w < workers_; ++w)
      workspaces_.push_back(std::make_unique<RunWorkspace>(period, pool_));
  }

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
    for_each_task(workers_, runs.size(), [&](int worker, std::size_t i) {
      read_run(runs[i], *workspaces_[static_cast<std::size_t>(worker)]);
    });
  }

  void read_excitation(std::size_t realization) {
    const std::vector<UsedRun>& runs = realizations_[realization].runs;
    std::vector<RunExcitation> excitation(runs.size());
    for_each_task(workers_, runs.size(), [&](int worker, std::size_t e) {
      excitation[e] =
          read_run_excitation(runs[e], workspaces_[static_cast<std::size_t>(worker)]->dft);
      excitation[e].period.resize(0, 0);  // saves memory: the samples of all runs are large
    });
    gathering_.excite(realization, excitation);
  }

  void read_run(const Run& run, RunWorkspace& w) {
    const RunExcitation excitation = read_run_excitation(*run.used, w.dft);
    run.part->begin(*run.used, excitation.period);
    if (watch_start_) run.part->watch_start(*run.used, excitation.spectrum.lines, sensors_, w);
    run.part->note(for_each_period(
        *run.used, w, [this](double bytes) { bytes_.add(bytes); },
        [&](int) { run.part->take(w, nullptr); },
        [&](int, const std::string&) { run.part->leave_out(); }));
    run.part->end();
  }

  std::vector<RealizationRuns> realizations_;
  ByteCounter bytes_;
  HealthGathering gathering_;
  bool watch_start_;  // lpm models the transient
  std::vector<Eigen::Index> sensors_;
  int workers_ = 1;
  MatrixPool pool_;
  std::vector<std::unique_ptr<RunWorkspace>> workspaces_;
};

}  // namespace

int RealizationRecord::scatter_dof() const noexcept {
  return std::accumulate(periods.begin(), periods.end(), 0) - static_cast<int>(periods.size());
}

Eigen::MatrixXcd RealizationRecord::mean(const Eigen::MatrixXcd& columns) const {
  Eigen::MatrixXcd means(columns.rows(), experiments());
  Eigen::Index first = 0;
  for (Eigen::Index e = 0; e < experiments(); ++e) {
    const Eigen::Index P = periods[static_cast<std::size_t>(e)];
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
    const Eigen::Index P = periods[static_cast<std::size_t>(e)];
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
