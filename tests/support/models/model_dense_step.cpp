#include "tests/support/models/model_dense_step.hpp"

#include <cmath>
#include <numbers>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/models/model_reference.hpp"

namespace stageid::test {
namespace {

using Complex = std::complex<double>;

double line_omega(const DenseProblem& problem, Eigen::Index k) {
  return 2.0 * std::numbers::pi * problem.frequency_hz[k];
}

std::vector<double> coefficients(const Submodel& s) {
  return {s.denominator.begin() + 1, s.denominator.end()};
}

/// The coefficients of A(s)^2 without its leading 1.
std::vector<double> squared(const std::vector<double>& a) {
  std::vector<double> full = {1.0};
  full.insert(full.end(), a.begin(), a.end());
  std::vector<double> product(2 * full.size() - 1, 0.0);
  for (std::size_t i = 0; i < full.size(); ++i)
    for (std::size_t j = 0; j < full.size(); ++j) product[i + j] += full[i] * full[j];
  return {product.begin() + 1, product.end()};
}

double delay_of_channel(const AdditiveModel& model, Eigen::Index c) {
  const double input =
      model.input_delay_s.size() > 0 ? model.input_delay_s[c / model.n_outputs()] : 0.0;
  const double output =
      model.output_delay_s.size() > 0 ? model.output_delay_s[c % model.n_outputs()] : 0.0;
  return input + output;
}

Complex hold_of(const DenseProblem& problem, const RationalFunction& function, Eigen::Index k,
                Eigen::Index c) {
  const double rate = problem.model.sample_rate_hz;
  return through(function, problem.hold, line_omega(problem, k), rate > 0.0 ? 1.0 / rate : 0.0,
                 delay_of_channel(problem.model, c));
}

/// vec P_i(j omega_k)
Eigen::VectorXcd submodel_response(const DenseProblem& problem, const Submodel& s, Eigen::Index k) {
  Eigen::VectorXcd p = Eigen::VectorXcd::Zero(problem.channels());
  for (std::size_t m = 0; m < s.numerator.size(); ++m)
    for (Eigen::Index c = 0; c < p.size(); ++c)
      p[c] += s.numerator[m].reshaped()[c] *
              hold_of(problem, {s.integrators, coefficients(s), static_cast<int>(m)}, k, c);
  return p;
}

Eigen::VectorXcd error_at(const DenseProblem& problem, Eigen::Index k) {
  Eigen::VectorXcd E = problem.G.col(k);
  for (const Submodel& s : problem.model.submodels) E -= submodel_response(problem, s, k);
  return E;
}

/// A_i(j omega_k)
Complex denominator_at(const DenseProblem& problem, const Submodel& s, Eigen::Index k) {
  return 1.0 / evaluate({0, coefficients(s), 0}, Complex(0.0, line_omega(problem, k)));
}

/// The numerator columns of theta_i: s^m / (s^l A_i) for its own channel.
void fill_numerator_columns(const DenseProblem& problem, const Submodel& s, Eigen::Index k,
                            Eigen::Index first, Eigen::MatrixXcd& rows) {
  for (std::size_t m = 0; m < s.numerator.size(); ++m)
    for (Eigen::Index c = 0; c < problem.channels(); ++c)
      rows(c, first + static_cast<Eigen::Index>(m) * problem.channels() + c) =
          hold_of(problem, {s.integrators, coefficients(s), static_cast<int>(m)}, k, c);
}

Eigen::MatrixXd real_product(const Eigen::MatrixXcd& left, const Eigen::VectorXd& W,
                             const Eigen::MatrixXcd& right) {
  const Eigen::MatrixXcd weighted = W.cast<Complex>().asDiagonal() * right;
  return (left.adjoint() * weighted).real();
}

Eigen::MatrixXd solved(const Eigen::MatrixXd& M, const Eigen::MatrixXd& rhs) {
  return solve(M.cast<Complex>(), rhs.cast<Complex>()).real();
}

}  // namespace

Eigen::VectorXd beta_of(const AdditiveModel& model) {
  std::vector<double> beta;
  for (const Submodel& s : model.submodels) {
    beta.insert(beta.end(), s.denominator.begin() + 1, s.denominator.end());
    for (const Eigen::MatrixXd& B : s.numerator)
      for (const double value : B.reshaped()) beta.push_back(value);
  }
  return Eigen::Map<const Eigen::VectorXd>(beta.data(), static_cast<Eigen::Index>(beta.size()));
}

std::vector<Eigen::Index> first_of_theta(const AdditiveModel& model) {
  std::vector<Eigen::Index> first = {0};
  for (const Submodel& s : model.submodels) {
    Eigen::Index size = static_cast<Eigen::Index>(s.denominator.size()) - 1;
    for (const Eigen::MatrixXd& B : s.numerator) size += B.size();
    first.push_back(first.back() + size);
  }
  return first;
}

Eigen::MatrixXcd instrument_rows(const DenseProblem& problem, Eigen::Index k) {
  const std::vector<Eigen::Index> first = first_of_theta(problem.model);
  Eigen::MatrixXcd rows = Eigen::MatrixXcd::Zero(problem.channels(), first.back());
  for (std::size_t i = 0; i < problem.model.submodels.size(); ++i) {
    const Submodel& s = problem.model.submodels[i];
    const auto n = static_cast<int>(s.denominator.size()) - 1;
    // -s^q P_i / A_i = -sum_m B_m s^(m+q) / (s^l A_i^2), as one function that a hold can act on.
    for (int q = 1; q <= n; ++q)
      for (std::size_t m = 0; m < s.numerator.size(); ++m)
        for (Eigen::Index c = 0; c < problem.channels(); ++c)
          rows(c, first[i] + q - 1) -=
              s.numerator[m].reshaped()[c] *
              hold_of(problem, {s.integrators, squared(coefficients(s)), q + static_cast<int>(m)},
                      k, c);
    fill_numerator_columns(problem, s, k, first[i] + n, rows);
  }
  return rows;
}

Eigen::MatrixXcd regressor_rows(const DenseProblem& problem, Eigen::Index k) {
  const std::vector<Eigen::Index> first = first_of_theta(problem.model);
  const Eigen::VectorXcd E = error_at(problem, k);
  Eigen::MatrixXcd rows = Eigen::MatrixXcd::Zero(problem.channels(), first.back());
  for (std::size_t i = 0; i < problem.model.submodels.size(); ++i) {
    const Submodel& s = problem.model.submodels[i];
    const auto n = static_cast<Eigen::Index>(s.denominator.size()) - 1;
    const Eigen::VectorXcd g = E + submodel_response(problem, s, k);
    const Complex A = denominator_at(problem, s, k);
    Complex power = 1.0;
    for (Eigen::Index q = 1; q <= n; ++q) {
      power *= Complex(0.0, line_omega(problem, k));
      rows.col(first[i] + q - 1) = -power / A * g;
    }
    fill_numerator_columns(problem, s, k, first[i] + n, rows);
  }
  return rows;
}

PaperStep paper_step(const DenseProblem& problem, Left left) {
  const std::vector<Eigen::Index> first = first_of_theta(problem.model);
  const auto K = static_cast<Eigen::Index>(problem.model.submodels.size());
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(first.back(), first.back());
  Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(first.back(), K);
  for (Eigen::Index k = 0; k < problem.G.cols(); ++k) {
    const Eigen::MatrixXcd phi = regressor_rows(problem, k);
    const Eigen::MatrixXcd z = left == Left::instrument ? instrument_rows(problem, k) : phi;
    const Eigen::VectorXcd E = error_at(problem, k);
    Eigen::MatrixXcd upsilon(problem.channels(), K);
    for (Eigen::Index i = 0; i < K; ++i) {
      const Submodel& s = problem.model.submodels[i];
      upsilon.col(i) = (E + submodel_response(problem, s, k)) / denominator_at(problem, s, k);
    }
    M += real_product(z, problem.W.col(k), phi);
    rhs += real_product(z, problem.W.col(k), upsilon);
  }
  PaperStep step{solved(M, rhs), Eigen::VectorXd(first.back())};
  for (Eigen::Index i = 0; i < K; ++i) {
    const Eigen::Index begin = first[i];
    const Eigen::Index size = first[static_cast<std::size_t>(i) + 1] - begin;
    step.next_beta.segment(begin, size) = step.solution.col(i).segment(begin, size);
  }
  return step;
}

Eigen::VectorXd gauss_newton_step(const DenseProblem& problem) {
  const Eigen::Index n = first_of_theta(problem.model).back();
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd r = Eigen::VectorXd::Zero(n);
  for (Eigen::Index k = 0; k < problem.G.cols(); ++k) {
    const Eigen::MatrixXcd J = instrument_rows(problem, k);
    M += real_product(J, problem.W.col(k), J);
    r += real_product(J, problem.W.col(k), error_at(problem, k));
  }
  return solved(M, r);
}

double first_order_condition(const DenseProblem& problem, bool common_delay) {
  const Eigen::Index n = first_of_theta(problem.model).back();
  Eigen::VectorXd diagonal = Eigen::VectorXd::Zero(n + 1);
  Eigen::VectorXd r = Eigen::VectorXd::Zero(n + 1);
  double total = 0.0;
  // The derivative to a common delay, fourth order in a step of 1e-3 of the fastest line's radian.
  Eigen::MatrixXcd slope = Eigen::MatrixXcd::Zero(problem.channels(), problem.G.cols());
  if (common_delay) {
    const double h = 1e-3 / line_omega(problem, problem.G.cols() - 1);
    const auto shifted = [&](double by) {
      AdditiveModel model = problem.model;
      model.input_delay_s.array() += by;
      return reference_response(model, problem.frequency_hz, problem.hold);
    };
    slope =
        (8.0 * (shifted(h) - shifted(-h)) - (shifted(2.0 * h) - shifted(-2.0 * h))) / (12.0 * h);
  }
  for (Eigen::Index k = 0; k < problem.G.cols(); ++k) {
    Eigen::MatrixXcd J(problem.channels(), n + 1);
    J << instrument_rows(problem, k), slope.col(k);
    const Eigen::VectorXcd E = error_at(problem, k);
    const Eigen::VectorXd W = problem.W.col(k);
    r += real_product(J, W, E);
    diagonal += (W.asDiagonal() * J.cwiseAbs2()).colwise().sum().transpose();
    total += W.dot(E.cwiseAbs2());
  }
  double largest = 0.0;
  for (Eigen::Index i = 0; i < n + (common_delay ? 1 : 0); ++i)
    largest = std::max(largest, std::abs(r[i]) / std::sqrt(diagonal[i] * total));
  return largest;
}

}  // namespace stageid::test
