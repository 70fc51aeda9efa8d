#include "frf/runs/realization_spectra.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

namespace stageid {
namespace {

/// Whether row `row` of the spectra is nonzero in any run.
bool moves(const RealizationSpectra& spectra, std::size_t runs, Eigen::Index row) {
  for (std::size_t e = 0; e < runs; ++e) {
    const Eigen::MatrixXcd& mean = spectra.run(e).mean;
    for (Eigen::Index k = 0; k < mean.cols(); ++k)
      if (mean(row, k) != 0.0) return true;
  }
  return false;
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
  for (Eigen::Index e = 0; e < experiments(); ++e) {
    R.col(e) = excitation_[static_cast<std::size_t>(e)].col(k);
  }
  return R;
}

Eigen::MatrixXcd RealizationSpectra::response(Eigen::Index k) const {
  Eigen::MatrixXcd Z(runs_.front().mean.rows(), experiments());
  for (Eigen::Index e = 0; e < experiments(); ++e) {
    Z.col(e) = runs_[static_cast<std::size_t>(e)].mean.col(k);
  }
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
  for (std::size_t e = 0; e < runs_.size(); ++e)
    if (runs_[e].scatter_dof > 0) sum += scatter(e, k);
  return sum;
}

Eigen::MatrixXcd RealizationSpectra::scatter(std::size_t experiment, Eigen::Index k) const {
  const RunSpectra& run = runs_[experiment];
  const Eigen::Index n = run.mean.rows();
  Eigen::MatrixXcd full(n, n);
  Eigen::Index entry = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j, ++entry) {
      full(i, j) = {run.scatter_re(entry, k), run.scatter_im(entry, k)};
      full(j, i) = std::conj(full(i, j));
    }
  }
  return full;
}

void refuse_constant_inputs(const RealizationRuns& realization, const RealizationSpectra& spectra,
                            const ChannelChoice& channels) {
  const auto outputs = std::ssize(channels.outputs);
  for (std::size_t i = 0; i < channels.estimated.size(); ++i) {
    if (moves(spectra, realization.runs.size(), outputs + static_cast<Eigen::Index>(i))) continue;
    const UsedRun& run = realization.runs.front();
    const auto channel = static_cast<std::size_t>(channels.estimated[i]);
    throw std::invalid_argument(fmt::format(
        "{}/actuators: channel {} is constant throughout realization {} (counted from 1), so the "
        "response cannot be estimated. Check its cable and which signal is recorded",
        run.place(), run.log->info().actuators.names[channel], realization.realization + 1));
  }
}

}  // namespace stageid
