#include "estimation/products/pair_reduction.hpp"

#include <algorithm>
#include <array>

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// Loss of accuracy beyond which a pair is multiplied out; the remaining accuracy is 1e-9.
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

/// Highest order of the fractions in a column.
int order(const FractionColumn& column) { return column.squared == 0.0 ? 1 : 2; }

/// Largest order(left) + order(right) for which products of the fractions of two pairs of poles are expanded into
/// sums. The ratio of the terms to the product at the highest line grows with that order.
Eigen::MatrixXi largest_orders(const FractionColumns& columns) {
  Eigen::MatrixXi orders(columns.pairs(), columns.pairs());
  const double highest = columns.highest_rad_s * columns.highest_rad_s;
  const auto beyond = [&](Complex rad_s) { return std::max(1.0, highest / std::norm(rad_s)); };
  for (Eigen::Index i = 0; i < orders.rows(); ++i)
    for (Eigen::Index j = 0; j <= i; ++j) {
      const Complex l = columns.lambda[i];
      const Complex r = columns.lambda[j];
      const double nearest = std::max(beyond(l + r), beyond(l + std::conj(r)));
      double squared_loss = beyond(l) * beyond(r);
      int order = 1;
      for (; order < 4 && squared_loss * nearest <= kLargestLoss * kLargestLoss; ++order)
        squared_loss *= nearest;
      orders(i, j) = orders(j, i) = order;
    }
  return orders;
}

}  // namespace

/// The product of a pair in columns of the base.
struct PairReduction::Terms {
  struct Term {
    Eigen::Index column;
    Complex factor;
  };
  std::array<Term, 17> all;  // a constant; q and p of both pairs of poles, and their squares
  std::size_t count = 0;

  void add(Eigen::Index column, Complex factor) { all[count++] = {column, factor}; }
  const Term* begin() const { return all.data(); }
  const Term* end() const { return all.data() + count; }
};

PairReduction::PairReduction(const FractionColumns& columns,
                             const std::vector<FractionColumn>& left,
                             const std::vector<FractionColumn>& right,
                             std::vector<ColumnPair> pairs)
    : columns_(&columns), left_(&left), right_(&right), pairs_(std::move(pairs)) {
  place_.assign(pairs_.size(), -1);
  const Eigen::MatrixXi largest = largest_orders(columns);
  for (std::size_t p = 0; p < pairs_.size(); ++p) {
    if (columns.pairs() > 0) {
      const FractionColumn& X = left[pairs_[p].left];
      const FractionColumn& Y = right[pairs_[p].right];
      if (X.pair >= 0 && Y.pair >= 0 && order(X) + order(Y) <= largest(X.pair, Y.pair)) continue;
    }
    place_[p] = std::ssize(direct_);
    direct_.push_back(pairs_[p]);
  }
}

PairReduction::Terms PairReduction::terms(std::size_t pair) const {
  const FractionColumn& X = (*left_)[pairs_[pair].left];
  const FractionColumn& Y = (*right_)[pairs_[pair].right];
  // conj(X): its coefficients are conjugated too.
  const std::array<Complex, 2> x = {std::conj(X.simple), std::conj(X.squared)};
  const std::array<Complex, 2> y = {Y.simple, Y.squared};
  const std::array<Complex, 2> y_conj = {std::conj(Y.simple), std::conj(Y.squared)};
  const Complex m = std::conj(columns_->place[X.pair]);
  const Complex l = columns_->place[Y.pair];
  // Of the four products of a pole of X and one of Y, two are the conjugates of these.
  Product with_l;
  Product with_conj;
  const auto add = columns_->exact ? add_sampled : add_continuous;
  add(l, m, x, y, with_l);
  add(std::conj(l), m, x, y_conj, with_conj);

  Terms out;
  out.add(0, X.constant * Y.constant + 2.0 * (with_l.one + with_conj.one).real());
  const Eigen::Index squares = columns_->simple_columns() - 1;
  // Times q: Re and Im of the base; conj(q) has the opposite sign of Im.
  const auto add_pair = [&](Eigen::Index column, Complex factor, double sign) {
    out.add(column, factor);
    out.add(column + 1, Complex(0.0, sign) * factor);
    out.add(column + 2, std::conj(factor));
    out.add(column + 3, Complex(0.0, sign) * std::conj(factor));
  };
  for (std::size_t o = 0; o < 2; ++o) {
    const Eigen::Index first = 1 + static_cast<Eigen::Index>(o) * squares;
    if (o == 0 || X.squared != 0.0)
      add_pair(first + 4 * X.pair, Y.constant * x[o] + with_l.left[o] + with_conj.left[o], -1.0);
    if (o == 0 || Y.squared != 0.0)
      add_pair(first + 4 * Y.pair,
               X.constant * y[o] + with_l.right[o] + std::conj(with_conj.right[o]), 1.0);
  }
  return out;
}

double PairReduction::weighted_sum(std::size_t pair, const Eigen::MatrixXd& S,
                                   const Eigen::Ref<const Eigen::VectorXd>& factor) const {
  double out = 0.0;
  for (const Terms::Term& term : terms(pair))
    out += term.factor.real() * S.col(term.column).dot(factor);
  return out;
}

template <typename Row>
Eigen::MatrixXd PairReduction::expand_rows(const Eigen::MatrixXd& direct, int threads,
                                           Row&& row) const {
  Eigen::MatrixXd out(direct.cols(), std::ssize(pairs_));
  for_each_pair(threads, [&](std::size_t p) {
    auto to = out.col(p);
    if (is_reduced(p))
      row(p, to);
    else
      to = direct.row(place_[p]).transpose();
  });
  return out.transpose();
}

Eigen::MatrixXd PairReduction::expand(const Eigen::MatrixXd& S, const Eigen::MatrixXd& direct,
                                      int threads) const {
  return expand_rows(direct, threads, [&](std::size_t p, auto out) {
    out.setZero();
    for (const auto& [column, factor] : terms(p)) out += factor.real() * S.col(column);
  });
}

Eigen::MatrixXd PairReduction::expand(const Eigen::MatrixXd& S_re, const Eigen::MatrixXd& S_im,
                                      const Eigen::MatrixXd& direct, int threads) const {
  return expand_rows(direct, threads, [&](std::size_t p, auto out) {
    out.setZero();
    for (const auto& [column, factor] : terms(p))
      out += factor.real() * S_re.col(column) - factor.imag() * S_im.col(column);
  });
}

}  // namespace stageid
