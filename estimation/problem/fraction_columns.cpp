#include "estimation/problem/fraction_columns.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimation/model/partial_fractions.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

constexpr double kLeastAngle =
    0.1;  // |Im| / |lambda|: two poles apart, so that their fractions are small

/// Whether the functions are strictly proper with one oscillating pair of poles.
bool is_one_pair(const SubmodelShape& shape, const Eigen::VectorXd& a) {
  if (shape.order != 2 || shape.integrators != 0 || shape.numerator_degree > 1) return false;
  const Complex lambda = roots(a)[0];
  return lambda.real() < 0.0 && std::abs(lambda.imag()) > kLeastAngle * std::abs(lambda);
}

/// The columns of one submodel; they do not depend on the lines.
class PairColumns {
 public:
  PairColumns(const HoldEquivalent& through, const Eigen::VectorXd& a, Complex lambda,
              Eigen::Index pair)
      : through_(through),
        a_(a),
        poles_{0.0, lambda, std::conj(lambda)},
        expansion_(through.expansion(lambda)),
        pair_(pair) {}

  /// s^power / A^times, with a sign.
  FractionColumn column(int power, int times, double sign) const {
    FractionColumn out{pair_};
    const double leading = std::pow(a_[1], times);
    PartialFractions{poles_, 0, times, power, leading}.for_each(
        [&](std::size_t r, Complex simple, Complex squared) {
          if (r != 1) return;  // the fractions of the conjugate follow by conjugation
          const auto coefficient = [&](std::size_t i) {
            return sign * (simple * expansion_.simple[i] + squared * expansion_.squared[i]);
          };
          out.constant = 2.0 * coefficient(0).real();
          out.simple = coefficient(1);
          out.squared = coefficient(2);
        });
    return out;
  }

  FractionColumn equation_error(Eigen::Index q) const {
    FractionColumn out{pair_};
    out.constant = !through_.exact() && q == a_.size() ? 1.0 / a_[q - 1] : 0.0;
    out.simple = equation_error_residue(through_, a_, poles_[1], q);
    return out;
  }

 private:
  const HoldEquivalent& through_;
  const Eigen::VectorXd& a_;
  std::vector<Complex> poles_;
  FractionExpansion expansion_;
  Eigen::Index pair_;
};

}  // namespace

std::complex<double> equation_error_residue(const HoldEquivalent& through,
                                            const Eigen::Ref<const Eigen::VectorXd>& a,
                                            Complex lambda, Eigen::Index q) {
  Complex slope = 0.0;  // A'(lambda)
  for (Eigen::Index i = a.size(); i > 0; --i)
    slope = slope * lambda + static_cast<double>(i) * a[i - 1];
  return through.place_slope(lambda) * std::pow(lambda, static_cast<int>(q)) / slope;
}

Eigen::MatrixXd fraction_base(const HoldEquivalent& through, const std::vector<Complex>& lambda,
                              bool squares) {
  const Eigen::Index simple = 1 + 4 * std::ssize(lambda);
  Eigen::MatrixXd out(through.lines(), squares ? 2 * simple - 1 : simple);
  out.col(0).setOnes();
  SplitMatrix q;
  Eigen::Index column = 1;
  for (const Complex pole : lambda)
    for (const Complex one : {pole, std::conj(pole)}) {
      through.reciprocal(one, q);
      out.col(column) = q.re;
      out.col(column + 1) = q.im;
      if (squares) {
        const Eigen::Index square = column + simple - 1;
        out.col(square) = q.re.array().square() - q.im.array().square();
        out.col(square + 1) = 2.0 * q.re.cwiseProduct(q.im);
      }
      column += 2;
    }
  return out;
}

FractionColumns fraction_columns(const HoldEquivalent& through, double highest_rad_s,
                                 const std::vector<SubmodelShape>& shapes,
                                 const std::vector<Eigen::VectorXd>& a, bool derivatives,
                                 const std::vector<Eigen::Index>& held) {
  FractionColumns out;
  out.exact = through.exact();
  out.highest_rad_s = highest_rad_s;
  out.first = through.first();
  Eigen::Index before = 0;  // coefficients of the submodels before
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const int order = derivatives ? shapes[i].order : 0;
    std::optional<PairColumns> pair;
    if (is_one_pair(shapes[i], a[i])) {
      const Complex lambda = roots(a[i])[0];
      pair.emplace(through, a[i], lambda, out.pairs());
      out.lambda.push_back(lambda);
      out.place.push_back(through.place(lambda));
    }
    for (int m = 0; m < shapes[i].functions(); ++m) {
      out.F.push_back(pair ? pair->column(m, 1, 1.0) : FractionColumn{});
      for (int q = 1; q <= order; ++q)  // d/da_q = -s^(m+q) / A^2
        if (std::ranges::find(held, before + q - 1) == held.end())
          out.D.push_back(pair ? pair->column(m + q, 2, -1.0) : FractionColumn{});
    }
    for (int q = 1; q <= order; ++q)
      out.Y.push_back(pair ? pair->equation_error(q) : FractionColumn{});
    before += shapes[i].order;
  }
  return out;
}

}  // namespace stageid
