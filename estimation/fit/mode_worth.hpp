#pragma once

#include <vector>

#include "estimation/model/model_structure.hpp"
#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// Of the weighted power of the data (-160 dB): below, it is rounding, since no measurement is more precise.
inline constexpr double kRoundingPower = 1e-16;

/// sum W |E|^2 of a model on every line. @param weights n_c x N
Eigen::VectorXd squares_of_lines(const FrfEstimate& frf, const AdditiveModel& model,
                                 const Eigen::MatrixXd& weights, const Team& team);

/// Whether a mode or a structure is worth its parameters: an extended Bayesian information criterion (Chen and Chen,
/// Biometrika 95 (2008) 759) with unknown scale of the variances; the parameters of a structure cost what noise may gain
/// with them. With correct variances it decides like the criterion with known variance; if the model cannot be right, it
/// does not fit its errors.
class ModeWorth {
 public:
  /// For fits whose residual is far above rounding.
  explicit ModeWorth(const FrfEstimate& frf);
  /// For a search. @param weights n_c x N, of the fits that are compared
  /// @param all_lines of the data that are judged, if `frf` has only some of them: what its fits gain beyond noise is
  /// taken to be alike on the others
  ModeWorth(const FrfEstimate& frf, const ModelStructure& structure, const Eigen::MatrixXd& weights,
            Eigen::Index all_lines = 0);

  /// Smaller is better.
  double criterion(const FitResult& fit) const;

  /// The criterion for the choice between general damping and modes beside the lines, which describe the same data. So
  /// both have the same kind of price: what noise may gain with their parameters.
  double criterion_of_structure(const FrfEstimate& frf, const FitResult& fit) const;

  /// The cost at which a fit of this model has that criterion.
  double cost_at(double criterion, const AdditiveModel& model, Eigen::Index parameters) const;

  /// Of a mode, in the units of the criterion; also its B_1 by BIC, because they are searched with its place.
  double cost_of_one() const;

  /// Decrease of sum W |E|^2 of `fit` above which one more mode is worth its parameters.
  double price(const FitResult& fit) const { return price(fit, parameters_of_mode_); }
  double price(const FitResult& fit, double parameters) const;
  /// What a mode that is not there gains by fitting noise, kClearly standard deviations above the mean.
  double most_by_chance(const FitResult& fit) const;

  /// Steps shorter than this many standard deviations of the parameters (Newton decrement) lower a cost by less than a
  /// hundredth of the worth of a mode, so they do not affect decisions.
  double deviation_tolerance() const;

  /// Without this limit, modes would be added to noise-free data without end.
  bool at_rounding(const FitResult& fit) const;

 private:
  double squares(const FitResult& fit) const;  ///< sum W |E|^2, not below rounding
  double penalty(const AdditiveModel& model, Eigen::Index parameters) const;

  double lines_ = 0.0;
  double all_lines_ = 0.0;
  double channels_ = 0.0;
  double data_ = 0.0;  ///< number of independent real numbers
  double parameters_of_mode_ = 0.0;
  double rounding_ = 1e-300;  ///< of sum W |E|^2
};

/// Candidates for removal: modes with a removal cost below `price`, the least worthy first, no two that could replace
/// each other, at most `most`. @returns indices of submodels, rising
std::vector<std::size_t> least_worthy(const FitResult& fit, double price, std::size_t most);

}  // namespace stageid
