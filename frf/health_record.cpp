#include "frf/health_record.hpp"

#include <algorithm>
#include <memory>
#include <numeric>

#include "frf/byte_counter.hpp"
#include "frf/excitation_spectrum.hpp"
#include "frf/health_gathering.hpp"
#include "frf/run_periods.hpp"
#include "frf/run_steps.hpp"
#include "frf/run_table.hpp"
#include "frf/worker_pool.hpp"

namespace stageid {
namespace {

/// The work on one set of logs.
class RecordReading {
 public:
  RecordReading(const std::vector<const LogReader*>& logs, const FrfOptions& options)
      : realizations_(choose_runs(logs, options)),
        bytes_(options, realizations_),
        gathering_(realizations_) {
    for (std::size_t m = 0; m < realizations_.size(); ++m)
      for (std::size_t e = 0; e < realizations_[m].runs.size(); ++e)
        runs_.push_back({&realizations_[m].runs[e], &gathering_.part(m, e)});
    const int period = runs_.front().used->log->info().period_samples;
    workers_ = static_cast<int>(
        std::min(static_cast<std::size_t>(worker_count(options.threads)), runs_.size()));
    for (int w = 0; w < workers_; ++w)
      workspaces_.push_back(std::make_unique<RunWorkspace>(period, pool_));
  }

  HealthRecord read() {
    read_excitation();
    for_each_task(workers_, runs_.size(), [&](int worker, std::size_t i) {
      read_run(runs_[i], *workspaces_[static_cast<std::size_t>(worker)]);
    });
    return gathering_.finish();
  }

 private:
  struct Run {
    const UsedRun* used;
    HealthPart* part;
  };

  void read_excitation() {
    const std::vector<UsedRun>& runs = realizations_.front().runs;
    std::vector<ExcitationSpectrum> spectra(runs.size());
    for_each_task(workers_, runs.size(), [&](int worker, std::size_t e) {
      spectra[e] =
          read_run_excitation(runs[e], workspaces_[static_cast<std::size_t>(worker)]->dft).spectrum;
    });
    std::vector<const ExcitationSpectrum*> all;
    for (const ExcitationSpectrum& spectrum : spectra) all.push_back(&spectrum);
    gathering_.excite(all);
  }

  void read_run(const Run& run, RunWorkspace& w) {
    bool clean = false;
    const auto take = [&](int) {
      clean = true;
      run.part->take(w, nullptr);
    };
    for_each_period(
        *run.used, w, [this](double bytes) { bytes_.add(bytes); }, take,
        [&](int) { run.part->leave_out_marked(); });
    if (!clean) refuse_marked_run(*run.used);
  }

  std::vector<RealizationRuns> realizations_;
  ByteCounter bytes_;
  HealthGathering gathering_;
  std::vector<Run> runs_;
  int workers_ = 1;
  MatrixPool pool_;
  std::vector<std::unique_ptr<RunWorkspace>> workspaces_;
};

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
                                const FrfOptions& options) {
  RecordReading reading(logs, options);
  return reading.read();
}

}  // namespace stageid
