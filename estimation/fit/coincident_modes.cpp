#include "estimation/fit/coincident_modes.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/fit/overlapping_modes.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/model/model_structure.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

int modes_of(int rank) { return std::max(rank, 1); }

void place(double frequency_factor, double damping_factor, Submodel& s) {
  const double a2 = s.denominator[2] / (frequency_factor * frequency_factor);
  const double zeta = s.damping_ratio() * damping_factor;
  s.denominator = {1.0, 2.0 * zeta * std::sqrt(a2), a2};
}

/// `tied` with a copy of mode `i` after it.
TiedModel doubled(TiedModel tied, std::size_t i) {
  const auto at = static_cast<std::ptrdiff_t>(i);
  tied.ranks[i] = 0;
  tied.ranks.insert(tied.ranks.begin() + at, 0);
  tied.model.submodels.insert(tied.model.submodels.begin() + at, tied.model.submodels[i]);
  return tied;
}

/// How two modes are separated: relative changes of frequency and damping ratio.
struct Direction {
  double frequency;
  double damping;
};

std::optional<TiedModel> parted(const FrfEstimate& frf, const TiedModel& tied, std::size_t i,
                                const FitOptions& options, const Direction& probe) {
  TiedModel two = doubled(tied, i);
  Submodel& one = two.model.submodels[i];
  Submodel& other = two.model.submodels[i + 1];
  place(1.0 + probe.frequency, 1.0 + probe.damping, one);
  place(1.0 - probe.frequency, 1.0 - probe.damping, other);
  FitOptions still = options;
  still.residue_rank = still.rigid_body_rank = still.max_iterations = 0;
  still.mode_ranks.clear();
  still.uncertainty = false;
  const FitResult fit = fit_additive_model(frf, two.model, still);
  if (fit.status() == FitStatus::singular) return std::nullopt;
  const Eigen::MatrixXd& upper = fit.model.submodels[i].numerator[0];
  const Eigen::MatrixXd& lower = fit.model.submodels[i + 1].numerator[0];

  const auto sum = svd(Eigen::MatrixXd(upper + lower), Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Eigen::MatrixXd U = sum.matrixU().leftCols(2);
  const Eigen::MatrixXd V = sum.matrixV().leftCols(2);
  const Eigen::Vector2d S = sum.singularValues().head(2);
  const Eigen::Matrix2d pencil =
      U.transpose() * (upper - lower) * V * S.cwiseInverse().asDiagonal();
  const auto eigen = general_eigen(pencil);
  const Eigen::Vector2cd values = eigen.eigenvalues();
  if (!pencil.allFinite() || values[0].imag() != 0.0 || values[0] == values[1]) return std::nullopt;
  const Eigen::Matrix2d T = eigen.eigenvectors().real();
  const Eigen::MatrixXd left = U * T;
  const Eigen::MatrixXd right = (T.inverse() * S.asDiagonal() * V.transpose()).transpose();
  two.model = fit.model;
  two.model.submodels[i].denominator = two.model.submodels[i + 1].denominator =
      tied.model.submodels[i].denominator;
  const double widest = kLargestPart * 2.0 * tied.model.submodels[i].damping_ratio();
  for (Eigen::Index k = 0; k < 2; ++k) {
    Submodel& s = two.model.submodels[i + static_cast<std::size_t>(k)];
    const double delta = values[k].real();
    place(1.0 + std::clamp(delta * probe.frequency, -widest, widest),
          1.0 + std::clamp(delta * probe.damping, -kLargestPart, kLargestPart), s);
    s.numerator[0] = left.col(k) * right.col(k).transpose();
  }
  return two;
}

}  // namespace

TiedModel with_tied(const TiedModel& tied, std::size_t i, std::size_t j) {
  TiedModel out{with_one_of(tied.model, i, j), tied.ranks};
  out.ranks[i] = modes_of(out.ranks[i]) + modes_of(out.ranks[j]);
  out.ranks.erase(out.ranks.begin() + static_cast<std::ptrdiff_t>(j));
  for (std::size_t m = 0; m < out.model.submodels[i].numerator.size(); ++m)
    out.model.submodels[i].numerator[m] += tied.model.submodels[j].numerator[m];
  return out;
}

TiedModel with_coincident_tied(const AdditiveModel& model) {
  TiedModel out{model, std::vector<int>(model.submodels.size(), 0)};
  for (std::size_t i = 0; i < out.model.submodels.size(); ++i)
    for (std::size_t j = i + 1; j < out.model.submodels.size();) {
      const std::vector<Submodel>& all = out.model.submodels;
      if (is_searched_mode(all[i]) && is_searched_mode(all[j]) &&
          all[i].denominator == all[j].denominator)
        out = with_tied(out, i, j);
      else
        ++j;
    }
  return out;
}

std::optional<TiedModel> with_parted(const FrfEstimate& frf, const TiedModel& tied, std::size_t i,
                                     const FitOptions& options) {
  const double width = 2.0 * tied.model.submodels[i].damping_ratio();
  if (auto apart = parted(frf, tied, i, options, {0.5 * kSmallPart * width, 0.0})) return apart;
  return parted(frf, tied, i, options, {0.0, kSmallPart});
}

void split_tied(const std::vector<int>& ranks, FitResult& fit) {
  std::vector<std::size_t> sources;
  std::vector<Submodel> parts;
  for (std::size_t i = 0; i < ranks.size(); ++i) {
    const Submodel& whole = fit.model.submodels[i];
    if (ranks[i] < 2) {
      sources.push_back(i);
      parts.push_back(whole);
      continue;
    }
    const auto sum = svd(whole.numerator[0], Eigen::ComputeThinU | Eigen::ComputeThinV);
    for (Eigen::Index k = 0; k < std::min<Eigen::Index>(ranks[i], sum.singularValues().size());
         ++k) {
      Submodel part = whole;
      part.numerator[0] =
          sum.singularValues()[k] * sum.matrixU().col(k) * sum.matrixV().col(k).transpose();
      part.numerator_std.clear();
      part.residue_rank = 1;
      sources.push_back(i);
      parts.push_back(std::move(part));
    }
  }
  rearrange(sources, fit);
  fit.model.submodels = std::move(parts);
}

}  // namespace stageid
