#include "frf/realization_spectra.hpp"

#include <utility>

namespace stageid {

RealizationSpectra::RealizationSpectra(int realization, std::vector<Eigen::MatrixXcd> excitation,
                                       MatrixPool& pool)
    : pool_(pool),
      realization_(realization),
      excitation_(std::move(excitation)),
      runs_(excitation_.size()),
      arrived_(excitation_.size(), 0) {}

RealizationSpectra::~RealizationSpectra() {
  pool_.give_back(std::move(scatter_re_));
  pool_.give_back(std::move(scatter_im_));
}

void RealizationSpectra::add(std::size_t experiment, RunSpectra&& spectra) {
  runs_[experiment] = std::move(spectra);
  arrived_[experiment] = 1;
  while (folded_ < runs_.size() && arrived_[folded_] != 0) fold(runs_[folded_++]);
}

void RealizationSpectra::fold(RunSpectra& spectra) {
  if (spectra.scatter_dof > 0) {
    scatter_dof_ += spectra.scatter_dof;
    if (scatter_re_.size() == 0) {
      scatter_re_ = std::move(spectra.scatter_re);
      scatter_im_ = std::move(spectra.scatter_im);
    } else {
      scatter_re_ += spectra.scatter_re;
      scatter_im_ += spectra.scatter_im;
    }
  }
  pool_.give_back(std::move(spectra.scatter_re));
  pool_.give_back(std::move(spectra.scatter_im));
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

double RealizationSpectra::scatter_dof(Eigen::Index k) const {
  double dof = 0.0;
  for (const RunSpectra& run : runs_) dof += run.dof(k);
  return dof;
}

Eigen::MatrixXcd RealizationSpectra::scatter(Eigen::Index k) const {
  const Eigen::Index n = runs_.front().mean.rows();
  Eigen::MatrixXcd full(n, n);
  Eigen::Index entry = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j, ++entry) {
      full(i, j) = {scatter_re_(entry, k), scatter_im_(entry, k)};
      full(j, i) = std::conj(full(i, j));
    }
  }
  return full;
}

}  // namespace stageid
