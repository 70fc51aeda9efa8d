#pragma once

#include <vector>

#include "estimation/model/model_structure.hpp"
#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// Of the weighted power of the data (-160 dB): less is rounding, no more precise measurement exists.
inline constexpr double kRoundingPower = 1e-16;

/// BIC of a fit with the scale of the variances unknown, in units of 2 ln(likelihood); the smaller the better. For
/// models whose parameters differ; where modes are searched on the lines, their places cost too: ModeWorth.
double information_criterion(const FrfEstimate& frf, const FitResult& fit);

/// What sum W |E|^2 of `fit` must rise by without its mode of so many parameters for that to be worth them, see ModeWorth.
double price_of_mode(const FrfEstimate& frf, const FitResult& fit, double parameters);

/// Whether a mode is worth its parameters: an extended Bayesian information criterion (Chen and Chen,
/// Biometrika 95 (2008) 759) with the scale of the variances unknown. Where the variances are right it
/// decides like the one with known variance; where the model cannot be right, it does not chase errors.
class ModeWorth {
 public:
  ModeWorth() = default;
  /// @param weights n_c x N, those of the fits that are compared
  ModeWorth(const FrfEstimate& frf, const ModelStructure& structure,
            const Eigen::MatrixXd& weights);

  /// The smaller the better.
  double criterion(const FitResult& fit) const;

  /// What sum W |E|^2 of `fit` must fall by for one more mode to be worth its parameters.
  double price(const FitResult& fit) const;

  /// Steps shorter than this many standard deviations of the parameters (Newton decrement) lower a cost
  /// by less than a hundredth of what a mode is worth: no decision needs them.
  double deviation_tolerance() const;

  /// Without this limit noise-free data ask for modes for ever.
  bool at_rounding(const FitResult& fit) const;

 private:
  double squares(const FitResult& fit) const;  ///< sum W |E|^2, not below rounding
  double cost_of_modes(int modes) const;

  double lines_ = 0.0;
  double data_ = 0.0;  ///< real numbers, as many as are independent
  double parameters_of_mode_ = 0.0;
  double rounding_ = 0.0;  ///< of sum W |E|^2
};

/// The modes to try to do without: those of removal cost below `price`, the least worthy first, no two
/// that could stand in for each other, at most that many. @returns indices of submodels, rising
std::vector<std::size_t> least_worthy(const FitResult& fit, double price, std::size_t most);

}  // namespace stageid
