#pragma once

#include "estimation/fit_options.hpp"
#include "estimation/model_structure.hpp"

namespace stageid {

/// Of the weighted power of the data (-160 dB): less is rounding, no more precise measurement exists.
inline constexpr double kRoundingPower = 1e-16;

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

  /// Holds the poles of the searched modes of `model` that noise hides: leaving such a mode out of `placed`,
  /// the fit of its numerators, costs less than the upper 5 % of the chi-square distribution with as many
  /// degrees of freedom as there are numerators. @returns how many
  int hold_hidden(const FitResult& placed, AdditiveModel& model) const;

  /// Steps shorter than this many standard deviations of the parameters (Newton decrement) lower a cost
  /// by less than a hundredth of what a mode is worth: no decision needs them.
  double deviation_tolerance() const;

  /// Without this limit noise-free data ask for modes for ever.
  bool at_rounding(const FitResult& fit) const;

 private:
  double squares(const FitResult& fit) const;  ///< sum W |E|^2, not below rounding
  double cost_of_modes(int modes) const;

  double lines_ = 0.0;
  double data_ = 0.0;  ///< real numbers
  double parameters_of_mode_ = 0.0;
  double rounding_ = 0.0;  ///< of sum W |E|^2
};

}  // namespace stageid
