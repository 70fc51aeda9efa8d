#include "estimation/fit/residue_ranks.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>
#include <ranges>

#include "acquisition/files/counted.hpp"
#include "estimation/equations/residue_form.hpp"
#include "estimation/equations/weighted_low_rank.hpp"
#include "estimation/fit/search_constants.hpp"
#include "estimation/model/model_structure.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

constexpr std::size_t kMostShown = 8;  // modes of higher rank

/// sum |B - B_r|^2 / variance of a mode, minimized over residues of rank r.
class RankDistance {
 public:
  explicit RankDistance(const Submodel& s)
      : n_outputs_(s.numerator[0].rows()),
        n_inputs_(s.numerator[0].cols()),
        shape_{0, 2, static_cast<int>(s.numerator.size()) - 1},
        a_(Eigen::Vector2d(s.denominator[1], s.denominator[2])),
        B_(n_outputs_ * n_inputs_, shape_.functions()),
        inverse_variance_(B_.rows(), B_.cols()) {
    const double omega = 1.0 / std::sqrt(a_[1]);
    for (Eigen::Index m = 0; m < B_.cols(); ++m) {
      const auto at = static_cast<std::size_t>(m);
      B_.col(m) = s.numerator[at].reshaped();
      inverse_variance_.col(m) = s.numerator_std[at].reshaped();
    }
    // Numerators are weighted by their effect at the frequency of the mode.
    const double largest =
        std::max(B_.col(0).cwiseAbs().maxCoeff(), omega * B_.rightCols(1).cwiseAbs().maxCoeff());
    for (Eigen::Index m = 0; m < B_.cols(); ++m) {
      const double least = kBestKnown * largest / std::pow(omega, static_cast<double>(m));
      inverse_variance_.col(m) =
          inverse_variance_.col(m).cwiseMax(std::max(least, 1e-300)).cwiseAbs2().cwiseInverse();
    }
    if (B_.cols() == 1)
      single_.emplace(B_.reshaped(n_outputs_, n_inputs_).cast<std::complex<double>>(),
                      inverse_variance_.reshaped(n_outputs_, n_inputs_));
  }

  double operator()(int rank) const {
    if (single_) return single_->factors(rank).distance;
    ResidueForm form(shape_, rank, n_outputs_, n_inputs_);
    Eigen::VectorXd weight = inverse_variance_.col(0);
    weight /= weight.maxCoeff();
    form.project(a_, B_, weight.reshaped(n_outputs_, n_inputs_));
    return (form.numerators(a_) - B_).cwiseAbs2().cwiseProduct(inverse_variance_).sum();
  }

  /// Whether the sum is larger than a limit. Most ranks that are too low are found without minimization.
  bool exceeds(double limit, int rank) const {
    return (single_ && single_->least_distance(rank) > limit) || (*this)(rank) > limit;
  }

  int parameters(int rank) const {
    return static_cast<int>(B_.cols() * (n_outputs_ - rank) * (n_inputs_ - rank));
  }

  /// The highest rank that can be held, and therefore tested.
  int highest() const {
    return B_.cols() > 1 ? 1 : static_cast<int>(std::min(n_outputs_, n_inputs_)) - 1;
  }

 private:
  Eigen::Index n_outputs_;
  Eigen::Index n_inputs_;
  SubmodelShape shape_;
  Eigen::VectorXd a_;
  Eigen::MatrixXd B_;  // n_c x m+1
  Eigen::MatrixXd inverse_variance_;
  std::optional<WeightedLowRank> single_;  // of modes with a single numerator
};

bool is_tested(const Submodel& s, const AdditiveModel& model) {
  if (!is_searched_mode(s) || s.numerator_std.size() != s.numerator.size()) return false;
  if (std::min(s.numerator[0].rows(), s.numerator[0].cols()) < 2) return false;
  if (!(s.numerator_std[0].maxCoeff() > 0.0)) return false;
  const double f = s.natural_frequency_hz();  // outside the lines it represents several modes
  return s.natural_frequency_std_hz && f > model.fit.band_hz[0] && f < model.fit.band_hz[1];
}

}  // namespace

std::vector<ResidueRankTest> residue_rank_tests(const AdditiveModel& model, double data) {
  std::vector<ResidueRankTest> out;
  const double price = std::log(data);
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& s = model.submodels[i];
    if (!is_tested(s, model)) continue;
    const RankDistance distance(s);
    ResidueRankTest test;
    test.submodel = i;
    test.natural_frequency_hz = s.natural_frequency_hz();
    test.chi_square = distance(1);
    test.parameters = distance.parameters(1);
    test.probability = tail_of_chi_square(test.chi_square, test.parameters);
    if (test.chi_square > price * test.parameters) {
      const auto higher = std::views::iota(2, std::max(2, distance.highest() + 1));
      const auto contradicted = [&](int rank) {
        return distance.exceeds(price * distance.parameters(rank), rank);
      };
      test.rank =
          2 + static_cast<int>(std::ranges::partition_point(higher, contradicted) - higher.begin());
    }
    out.push_back(test);
  }
  return out;
}

std::string describe(const std::vector<ResidueRankTest>& tests) {
  if (tests.empty()) return {};
  int of_one = 0;
  double least = 1.0;
  std::vector<std::string> higher;
  for (const ResidueRankTest& test : tests) {
    if (test.rank == 1) {
      ++of_one;
      least = std::min(least, test.probability);
    } else {
      higher.push_back(fmt::format("{:.6g} Hz {} (chi-square {:.4g} for {} parameters)",
                                   test.natural_frequency_hz, test.rank, test.chi_square,
                                   test.parameters));
    }
  }
  std::string text = "residue ranks that the data require: ";
  if (of_one > 0) {
    text += fmt::format("1 for {} (least probable deviation: p = {:.2g})", counted(of_one, "mode"),
                        least);
    if (!higher.empty()) text += "; ";
  }
  return text + listed(higher, kMostShown);
}

}  // namespace stageid
