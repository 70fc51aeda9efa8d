#include "frf/runs/realization_spectra.hpp"

#include <algorithm>
#include <utility>

#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

/// Whether row `row` of the spectra is nonzero in any run.
bool moves(const RealizationSpectra& spectra, Eigen::Index row) {
  return std::ranges::any_of(spectra.runs(), [row](const RunSpectra& run) {
    return (run.mean.row(row).array() != 0.0).any();
  });
}

}  // namespace

RealizationSpectra::RealizationSpectra(int realization, std::vector<Eigen::MatrixXcd> excitation,
                                       MatrixPool& pool)
    : pool_(pool),
      realization_(realization),
      excitation_(std::move(excitation)),
      runs_(excitation_.size()) {}

RealizationSpectra::~RealizationSpectra() {
  for (RunSpectra& run : runs_) {
    pool_.give_back(std::move(run.scatter_re));
    pool_.give_back(std::move(run.scatter_im));
  }
}

void RealizationSpectra::add(std::size_t experiment, RunSpectra&& spectra) {
  runs_[experiment] = std::move(spectra);
}

Eigen::MatrixXcd RealizationSpectra::excitation(Eigen::Index k) const {
  Eigen::MatrixXcd R(excitation_.front().rows(), experiments());
  Eigen::Index e = 0;
  for (const Eigen::MatrixXcd& run : excitation_) R.col(e++) = run.col(k);
  return R;
}

Eigen::MatrixXcd RealizationSpectra::response(Eigen::Index k) const {
  Eigen::MatrixXcd Z(runs_.front().mean.rows(), experiments());
  Eigen::Index e = 0;
  for (const RunSpectra& run : runs_) Z.col(e++) = run.mean.col(k);
  return Z;
}

int RealizationSpectra::scatter_dof() const {
  int dof = 0;
  for (const RunSpectra& run : runs_) dof += run.scatter_dof;
  return dof;
}

double RealizationSpectra::scatter_dof(Eigen::Index k) const {
  double dof = 0.0;
  for (const RunSpectra& run : runs_) dof += run.dof(k);
  return dof;
}

Eigen::MatrixXcd RealizationSpectra::scatter(Eigen::Index k) const {
  const Eigen::Index n = runs_.front().mean.rows();
  Eigen::MatrixXcd sum = Eigen::MatrixXcd::Zero(n, n);
  for (const RunSpectra& run : runs_)
    if (run.scatter_dof > 0) sum += run.scatter(k);
  return sum;
}

void refuse_constant_inputs(const RealizationRuns& realization, const RealizationSpectra& spectra,
                            const ChannelChoice& channels) {
  const auto outputs = std::ssize(channels.outputs);
  for (std::size_t i = 0; i < channels.estimated.size(); ++i) {
    if (moves(spectra, outputs + static_cast<Eigen::Index>(i))) continue;
    const UsedRun& run = realization.runs.front();
    fail_request(
        "{}/actuators: channel {} is constant throughout realization {} (counted from 1), so the "
        "response cannot be estimated. Check its cable and which signal is recorded",
        run.place(), run.log->info().actuators.name(channels.estimated[i]),
        realization.realization + 1);
  }
}

}  // namespace stageid
