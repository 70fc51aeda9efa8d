#include "estimation/mode_worth.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

constexpr double kUpper5Percent = 1.6449;  // of the normal distribution

}  // namespace

ModeWorth::ModeWorth(const FrfEstimate& frf, const ModelStructure& structure,
                     const Eigen::MatrixXd& weights)
    : lines_(static_cast<double>(frf.lines())),
      data_(2.0 * static_cast<double>(frf.response.size())),
      parameters_of_mode_(2.0 + (structure.general_damping ? 2.0 : 1.0) *
                                    static_cast<double>(frf.response.rows())),
      rounding_(kRoundingPower * (weights.array() * frf.response.cwiseAbs2().array()).sum()) {}

double ModeWorth::squares(const FitResult& fit) const {
  return std::max(2.0 * lines_ * fit.model.fit.cost, rounding_);
}

/// In units of 2 ln(likelihood): ln(data) for each parameter (BIC), and 2 ln(lines) for the choice of the
/// mode's place among them: without it the best of thousands of places is taken where none is right.
double ModeWorth::cost_of_modes(int modes) const {
  return modes * (parameters_of_mode_ * std::log(data_) + 2.0 * std::log(lines_));
}

double ModeWorth::criterion(const FitResult& fit) const {
  return data_ * std::log(squares(fit)) + cost_of_modes(count_modes(fit.model));
}

double ModeWorth::price(const FitResult& fit) const {
  return squares(fit) * -std::expm1(-cost_of_modes(1) / data_);
}

int ModeWorth::hold_hidden(const FitResult& placed, AdditiveModel& model) const {
  // Wilson and Hilferty's approximation of the quantile (PNAS 17 (1931) 684).
  const double n = parameters_of_mode_ - 2.0;
  const double root = 1.0 - 2.0 / (9.0 * n) + kUpper5Percent * std::sqrt(2.0 / (9.0 * n));
  const double noise = n * root * root * root * squares(placed) / data_;
  int hidden = 0;
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    Submodel& s = model.submodels[i];
    if (!is_searched_mode(s) || !(placed.removal_cost[i] < noise)) continue;
    s.frequency_held = s.damping_held = true;
    ++hidden;
  }
  return hidden;
}

double ModeWorth::deviation_tolerance() const { return std::sqrt(0.01 * cost_of_modes(1)); }

bool ModeWorth::at_rounding(const FitResult& fit) const { return squares(fit) <= rounding_; }

}  // namespace stageid
