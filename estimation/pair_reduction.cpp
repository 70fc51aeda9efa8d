#include "estimation/pair_reduction.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// Loss of accuracy beyond which a pair is multiplied out: what is left is 1e-9.
constexpr double kLargestLoss = 1e7;

/// conj(x_m-fraction of order i) times (x_l-fraction of order j) as a sum of fractions.
struct Product {
  Complex one = 0.0;
  std::array<Complex, 2> right = {};  // of q_l, q_l^2
  std::array<Complex, 2> left = {};   // of conj(q_m), conj(q_m)^2
};

/// x = j omega; m is conj(x_m).
void add_continuous(Complex l, Complex m, const std::array<Complex, 2>& of_left,
                    const std::array<Complex, 2>& of_right, Product& sum) {
  const Complex D = 1.0 / (l + m);
  const Complex c11 = of_left[0] * of_right[0];
  const Complex c12 = of_left[0] * of_right[1];
  const Complex c21 = of_left[1] * of_right[0];
  const Complex c22 = of_left[1] * of_right[1];
  const Complex both = D * (-c11 + D * (c12 + c21 - 2.0 * D * c22));
  sum.right[0] += both;
  sum.left[0] += both;
  sum.right[1] += D * (-c12 + D * c22);
  sum.left[1] += D * (-c21 + D * c22);
}

/// x = e^{j omega T}; m is conj(x_m).
void add_sampled(Complex l, Complex m, const std::array<Complex, 2>& of_left,
                 const std::array<Complex, 2>& of_right, Product& sum) {
  const Complex D = 1.0 / (1.0 - l * m);
  const Complex c11 = of_left[0] * of_right[0];
  const Complex c12 = of_left[0] * of_right[1];
  const Complex c21 = of_left[1] * of_right[0];
  const Complex c22 = of_left[1] * of_right[1];
  const Complex D2 = D * D;
  // Of N = 1 + l q_l + m conj(q_m), its derivatives to l and m, and both.
  const Complex of_N = c11 * D + (c12 * m + c21 * l + c22) * D2 + 2.0 * c22 * l * m * D2 * D;
  const Complex of_N_l = c12 * D + c22 * l * D2;
  const Complex of_N_m = c21 * D + c22 * m * D2;
  sum.one += of_N;
  sum.right[0] += l * of_N + of_N_l;
  sum.right[1] += l * of_N_l;
  sum.left[0] += m * of_N + of_N_m;
  sum.left[1] += m * of_N_m;
}

/// The order of the fractions in a column.
int order(const FractionColumn& column) { return column.squared == 0.0 ? 1 : 2; }

/// How many times larger than the product the terms of its sum become, at the highest line.
double loss(const FractionColumns& columns, const FractionColumn& left,
            const FractionColumn& right) {
  const Complex l = columns.lambda[static_cast<std::size_t>(left.pair)];
  const Complex r = columns.lambda[static_cast<std::size_t>(right.pair)];
  const double nearest = std::min(std::abs(l + r), std::abs(l + std::conj(r)));
  const auto beyond = [&](double rad_s) { return std::max(1.0, columns.highest_rad_s / rad_s); };
  return beyond(std::abs(l)) * beyond(std::abs(r)) *
         std::pow(beyond(nearest), order(left) + order(right) - 1);
}

}  // namespace

PairReduction::PairReduction(const FractionColumns& columns,
                             const std::vector<FractionColumn>& left,
                             const std::vector<FractionColumn>& right,
                             std::vector<ColumnPair> pairs)
    : pairs_(std::move(pairs)) {
  const Eigen::Index squares = columns.simple_columns() - 1;
  begin_.reserve(pairs_.size() + 1);
  begin_.push_back(0);
  for (const ColumnPair& pair : pairs_) {
    const FractionColumn* X = nullptr;
    const FractionColumn* Y = nullptr;
    if (columns.pairs() > 0) {
      X = &left[static_cast<std::size_t>(pair.left)];
      Y = &right[static_cast<std::size_t>(pair.right)];
    }
    if (X == nullptr || X->pair < 0 || Y->pair < 0 || loss(columns, *X, *Y) > kLargestLoss) {
      direct_.push_back(pair);
      begin_.push_back(terms_.size());
      continue;
    }
    // Times q: Re and Im of the base; times conj(q): the latter's sign is the other.
    const auto add = [&](Eigen::Index column, Complex factor, double sign) {
      terms_.push_back({column, factor});
      terms_.push_back({column + 1, Complex(0.0, sign) * factor});
    };
    double one = X->constant * Y->constant;
    std::array<std::array<Complex, 2>, 2> of_X = {};  // [which of the pair][order]
    std::array<std::array<Complex, 2>, 2> of_Y = {};
    for (std::size_t i = 0; i < 2; ++i) {
      const auto taken = [&](Complex c, bool conjugate) { return conjugate ? std::conj(c) : c; };
      // conj(X): its coefficients are conjugated too.
      const std::array<Complex, 2> x = {taken(X->simple, i == 0), taken(X->squared, i == 0)};
      const Complex m = taken(columns.place[static_cast<std::size_t>(X->pair)], i == 0);
      for (std::size_t o = 0; o < 2; ++o) of_X[i][o] += Y->constant * x[o];
      for (std::size_t j = 0; j < 2; ++j) {
        const std::array<Complex, 2> y = {taken(Y->simple, j == 1), taken(Y->squared, j == 1)};
        const Complex l = taken(columns.place[static_cast<std::size_t>(Y->pair)], j == 1);
        if (i == 0)
          for (std::size_t o = 0; o < 2; ++o) of_Y[j][o] += X->constant * y[o];
        Product product;
        if (columns.exact)
          add_sampled(l, m, x, y, product);
        else
          add_continuous(l, m, x, y, product);
        one += product.one.real();
        for (std::size_t o = 0; o < 2; ++o) {
          of_X[i][o] += product.left[o];
          of_Y[j][o] += product.right[o];
        }
      }
    }
    terms_.push_back({0, one});
    for (Eigen::Index o = 0; o < 2; ++o)
      for (Eigen::Index i = 0; i < 2; ++i) {
        const auto at = [&](const auto& c) {
          return c[static_cast<std::size_t>(i)][static_cast<std::size_t>(o)];
        };
        const Eigen::Index offset = 1 + 2 * i + o * squares;
        if (o == 0 || X->squared != 0.0) add(offset + 4 * X->pair, at(of_X), -1.0);
        if (o == 0 || Y->squared != 0.0) add(offset + 4 * Y->pair, at(of_Y), 1.0);
      }
    begin_.push_back(terms_.size());
  }
}

Eigen::VectorXd PairReduction::sum(std::size_t pair, const Eigen::MatrixXd& S) const {
  Eigen::VectorXd out = Eigen::VectorXd::Zero(S.rows());
  for (std::size_t t = begin_[pair]; t < begin_[pair + 1]; ++t)
    out += terms_[t].factor.real() * S.col(terms_[t].column);
  return out;
}

template <typename Row>
Eigen::MatrixXd PairReduction::expand_rows(const Eigen::MatrixXd& direct, Eigen::Index members,
                                           Row&& row) const {
  Eigen::MatrixXd out(members, static_cast<Eigen::Index>(pairs_.size()));
  Eigen::Index next = 0;
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    const auto column = static_cast<Eigen::Index>(p);
    if (is_reduced(p))
      out.col(column) = row(p);
    else
      out.col(column) = direct.row(next++).transpose();
  }
  return out.transpose();
}

Eigen::MatrixXd PairReduction::expand(const Eigen::MatrixXd& S,
                                      const Eigen::MatrixXd& direct) const {
  return expand_rows(direct, direct.cols(), [&](std::size_t p) { return sum(p, S); });
}

Eigen::MatrixXd PairReduction::expand(const Eigen::MatrixXd& S_re, const Eigen::MatrixXd& S_im,
                                      const Eigen::MatrixXd& direct) const {
  return expand_rows(direct, direct.cols(), [&](std::size_t p) {
    Eigen::VectorXd out = Eigen::VectorXd::Zero(S_re.rows());
    for (std::size_t t = begin_[p]; t < begin_[p + 1]; ++t)
      out += terms_[t].factor.real() * S_re.col(terms_[t].column) -
             terms_[t].factor.imag() * S_im.col(terms_[t].column);
    return out;
  });
}

}  // namespace stageid
