#include "estimation/fit/mode_worth.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/fit/search_constants.hpp"
#include "estimation/problem/fit_problem.hpp"

namespace stageid {

namespace {

/// What so many parameters gain by fitting noise, kClearly standard deviations above the mean.
double most_by_noise(double parameters) {
  return parameters + kClearly * std::sqrt(2.0 * parameters);
}

/// What a part with so many parameters must gain: more than by noise, and so much that the response becomes more accurate.
/// Below twice their number, the error without them is smaller than their variance (Akaike). Hundreds of parameters, such
/// as general damping, would else be accepted because they imitate some other small error.
double gain_of_use(double parameters) {
  return std::max(2.0 * parameters, most_by_noise(parameters));
}

/// In units of 2 ln(likelihood). Poles and B_0 of the modes: ln(data) each (BIC). The other parts belong to a structure
/// that is one of a few, not the best of many, so each is right if it is of use at all: the B_1 of all modes, a
/// direct term, a rigid body, the delays. With ln(data) for each of the hundreds of parameters of many channels, a part
/// would be left out that shifts the modes by several of their standard deviations.
double cost_of_parameters(const AdditiveModel& model, double channels, double parameters,
                          double data) {
  double of_modes = 0.0;
  double of_damping = 0.0;
  double of_others = 0.0;
  double cost = 0.0;
  for (const Submodel& s : model.submodels) {
    const double numerators = channels * static_cast<double>(s.numerator.size());
    if (is_searched_mode(s)) {
      of_modes += 2.0 + channels;
      of_damping += numerators - channels;
    } else {
      of_others += s.order() + numerators;
      cost += gain_of_use(s.order() + numerators);
    }
  }
  const double of_delays = parameters - of_modes - of_damping - of_others;
  if (of_delays < 0.0) return parameters * std::log(data);  // residues of given ranks
  return cost + of_modes * std::log(data) + gain_of_use(of_damping) + gain_of_use(of_delays);
}

/// Also 2 ln(lines) for the choice of the frequency among the lines. Without it, the best of thousands of places would
/// be accepted even if none is right.
double cost_of_mode(double parameters, double data, double lines) {
  return parameters * std::log(data) + 2.0 * std::log(lines);
}

/// That cost in units of sum W |E|^2, whose value is `squares`.
double in_squares(double squares, double cost, double data) {
  return squares * -std::expm1(-cost / data);
}

}  // namespace

Eigen::VectorXd squares_of_lines(const FrfEstimate& frf, const AdditiveModel& model,
                                 const Eigen::MatrixXd& weights, const Team& team) {
  return sum_over_tiles(team, weights.rows(), weights.cols(), [&](DataRange tile) {
    const Eigen::MatrixXcd E =
        frf.response.middleRows(tile.first, tile.count) -
        response(model, frf.frequency_hz, model.hold, tile.first, tile.count);
    const auto W = weights.middleRows(tile.first, tile.count);
    return Eigen::VectorXd(W.cwiseProduct(E.cwiseAbs2()).colwise().sum().transpose());
  });
}

ModeWorth::ModeWorth(const FrfEstimate& frf)
    : lines_(static_cast<double>(frf.lines())),
      all_lines_(lines_),
      channels_(static_cast<double>(frf.response.rows())),
      data_(frf.independent_numbers()),
      parameters_of_mode_(2.0 + channels_) {}

ModeWorth::ModeWorth(const FrfEstimate& frf, const ModelStructure& structure,
                     const Eigen::MatrixXd& weights, Eigen::Index all_lines)
    : ModeWorth(frf) {
  if (all_lines > 0) all_lines_ = static_cast<double>(all_lines);
  data_ *= all_lines_ / lines_;
  if (structure.general_damping) parameters_of_mode_ += channels_;
  rounding_ = kRoundingPower * weighted_power(frf, weights);
}

double ModeWorth::squares(const FitResult& fit) const {
  return std::max(2.0 * lines_ * fit.model.fit.cost, rounding_);
}

double ModeWorth::cost_of_one() const {
  return cost_of_mode(parameters_of_mode_, data_, all_lines_);
}

double ModeWorth::criterion(const FitResult& fit) const {
  return data_ * std::log(squares(fit)) + penalty(fit.model, fit.parameters);
}

double ModeWorth::criterion_of_structure(const FrfEstimate& frf, const FitResult& fit) const {
  const double of_mode = 2.0 + channels_;
  const double saved = cost_of_mode(of_mode, data_, all_lines_) - gain_of_use(of_mode);
  const auto beside = std::ranges::count_if(fit.model.submodels, [&](const Submodel& s) {
    return is_searched_mode(s) && side_of_lines(frf, s.natural_frequency_hz()) != 0;
  });
  return criterion(fit) - static_cast<double>(beside) * saved;
}

double ModeWorth::penalty(const AdditiveModel& model, Eigen::Index parameters) const {
  const auto count = static_cast<double>(parameters);
  // Noise gains one per parameter on any number of lines, but the criterion of a part multiplies it with the lines.
  const double of_noise = (all_lines_ / lines_ - 1.0) * count;
  return cost_of_parameters(model, channels_, count, data_) +
         2.0 * count_modes(model) * std::log(all_lines_) + of_noise;
}

double ModeWorth::cost_at(double criterion, const AdditiveModel& model,
                          Eigen::Index parameters) const {
  return std::exp((criterion - penalty(model, parameters)) / data_) / (2.0 * lines_);
}

double ModeWorth::price(const FitResult& fit, double parameters) const {
  return in_squares(squares(fit), cost_of_mode(parameters, data_, all_lines_), data_);
}

double ModeWorth::most_by_chance(const FitResult& fit) const {
  return squares(fit) / data_ * most_by_noise(parameters_of_mode_);
}

double ModeWorth::deviation_tolerance() const { return std::sqrt(0.01 * cost_of_one()); }

bool ModeWorth::at_rounding(const FitResult& fit) const { return squares(fit) <= rounding_; }

std::vector<std::size_t> least_worthy(const FitResult& fit, double price, std::size_t most) {
  const std::vector<Submodel>& all = fit.model.submodels;
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (is_searched_mode(all[i]) && fit.removal_cost[i] < price) order.push_back(i);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return fit.removal_cost[a] < fit.removal_cost[b];
  });
  std::vector<std::size_t> out;
  for (const std::size_t i : order) {
    const double f = all[i].natural_frequency_hz();
    const bool stands_in = std::any_of(out.begin(), out.end(), [&](std::size_t o) {
      const double width = 4.0 * std::max(all[i].damping_ratio(), all[o].damping_ratio()) * f;
      return std::abs(all[o].natural_frequency_hz() - f) < width;
    });
    if (!stands_in && out.size() < most) out.push_back(i);
  }
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace stageid
