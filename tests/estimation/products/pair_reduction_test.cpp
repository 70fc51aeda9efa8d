// Functions as fractions, and sums of their products from sums of fractions, against the functions on
// the lines and their products written out.

#include "estimation/products/pair_reduction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "estimation/products/line_sums.hpp"
#include "estimation/products/weighted_products.hpp"
#include "tests/estimation/disturbed_problem.hpp"

namespace stageid::test_pair_reduction {

using test::RandomNumbers;

constexpr HoldModel kHolds[] = {HoldModel::none, HoldModel::phase, HoldModel::sinc,
                                HoldModel::exact};

/// 4 x 5 with a rigid body, modes of both kinds of damping, two of them close, and an overdamped one.
test::DenseProblem mixed_problem(HoldModel hold) {
  RandomNumbers random(31);
  test::DenseProblem problem;
  problem.hold = hold;
  problem.model = test::named_model(4, 5);
  if (hold != HoldModel::none) problem.model.sample_rate_hz = 1e4;
  problem.model.input_delay_s.setConstant(1.37e-4);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(300, 30.0, 1500.0);
  const auto mode = [&](double hz, double damping_ratio, int powers) {
    return test::empty_mode(problem.model, hz, damping_ratio, powers);
  };
  problem.model.submodels = {test::empty_submodel(problem.model, 2, {}, 1),
                             mode(240.0, 0.03, 1),
                             mode(500.0, 1.4, 1),
                             mode(800.0, 0.02, 2),
                             mode(806.0, 0.015, 1),
                             mode(1700.0, 0.005, 2)};
  test::measure_and_disturb(random, problem, 1e-3);
  return problem;
}

struct Case {
  test::Evaluated evaluated;
  FitProblem& fit = evaluated.fit;
  BasisGroup& group = evaluated.groups.at(0);
  SplitMatrix Y;
  explicit Case(HoldModel hold)
      : evaluated(mixed_problem(hold)), Y(EquationMethod(fit, evaluated.beta, FitMethod::riv).Y) {}
};

/// A column from its coefficients, without `first`.
Eigen::VectorXcd written_out(const FractionColumns& columns, const FractionColumn& column) {
  const std::complex<double> i(0.0, 1.0);
  const Eigen::Index squares = columns.simple_columns() - 1;
  const Eigen::Index at = 1 + 4 * column.pair;
  const auto part = [&](Eigen::Index from) -> Eigen::VectorXcd {
    return columns.base->col(from) + i * columns.base->col(from + 1);
  };
  return Eigen::VectorXcd::Constant(columns.base->rows(), column.constant) +
         column.simple * part(at) + std::conj(column.simple) * part(at + 2) +
         column.squared * part(at + squares) + std::conj(column.squared) * part(at + squares + 2);
}

void expect_columns(const FractionColumns& columns, const std::vector<FractionColumn>& expanded,
                    const SplitMatrix& functions, bool with_first, std::size_t fractions) {
  ASSERT_EQ(expanded.size(), static_cast<std::size_t>(functions.cols()));
  std::size_t found = 0;
  for (std::size_t c = 0; c < expanded.size(); ++c) {
    if (expanded[c].pair < 0) continue;
    ++found;
    Eigen::VectorXcd value = written_out(columns, expanded[c]);
    if (with_first)
      for (Eigen::Index k = 0; k < value.size(); ++k) value[k] *= columns.first(k, 0);
    Eigen::VectorXcd wanted(functions.re.rows());
    wanted.real() = functions.re.col(c);
    wanted.imag() = functions.im.col(c);
    // Two fractions of a conjugate pair cancel to the ratio of the mode's frequency and the line's.
    EXPECT_LT((value - wanted).norm(), 1e-11 * wanted.norm()) << c;
  }
  EXPECT_EQ(found, fractions);
}

TEST(FractionColumns, AreTheFunctionsOnTheLines) {
  for (const HoldModel hold : kHolds) {
    const Case c(hold);
    const FractionColumns& columns = c.group.fractions;
    ASSERT_EQ(columns.pairs(), 4);  // the rigid body and the overdamped mode are none
    expect_columns(columns, columns.F, c.group.F, true, 6);
    expect_columns(columns, columns.D, c.group.D, true, 12);
    expect_columns(columns, columns.Y, c.Y, false, 8);
  }
}

TEST(FractionColumns, OfNumeratorsAloneHaveNoSquares) {
  const Case c(HoldModel::exact);
  const BasisGroup bare = evaluate_groups(c.fit, c.evaluated.beta, false).at(0);
  EXPECT_TRUE(bare.fractions.D.empty());
  EXPECT_EQ(*bare.fractions.base, c.group.fractions.base->leftCols(17));
}

struct ReductionTest : testing::Test {
  void expect_sums(const Case& c, const std::vector<FractionColumn>& left,
                   const SplitMatrix& left_columns, const std::vector<FractionColumn>& right,
                   const SplitMatrix& right_columns, std::size_t least_reduced) {
    const auto pairs = all_pairs(std::ssize(left), std::ssize(right));
    const FractionColumns& fractions = c.group.fractions;
    const PairReduction reduction(fractions, left, right, pairs);
    EXPECT_GE(pairs.size() - reduction.direct().size(), least_reduced);
    EXPECT_GT(reduction.direct().size(), 0U);

    const Eigen::MatrixXd& W = *c.fit.W;
    const Eigen::VectorXd size =
        fractions.first.re.col(0).cwiseAbs2() + fractions.first.im.col(0).cwiseAbs2();
    Eigen::MatrixXd direct = Eigen::MatrixXd::Zero(std::ssize(reduction.direct()), W.rows());
    add_pair_sums(W, left_columns, right_columns, reduction.direct(), 0, direct);
    const Eigen::MatrixXd sums =
        reduction.expand(W * size.asDiagonal() * *fractions.base, direct, 2);
    Eigen::MatrixXd wanted = Eigen::MatrixXd::Zero(std::ssize(pairs), W.rows());
    add_pair_sums(W, left_columns, right_columns, pairs, 0, wanted);
    expect_close(pairs, wanted, sums, W, left_columns, right_columns);
  }

  /// To 1e-9 of what two columns' powers allow.
  static void expect_close(const std::vector<ColumnPair>& pairs, const Eigen::MatrixXd& wanted,
                           const Eigen::MatrixXd& sums, const Eigen::MatrixXd& W,
                           const SplitMatrix& left, const SplitMatrix& right) {
    const auto power = [&](const SplitMatrix& x) -> Eigen::MatrixXd {
      return W * (x.re.cwiseAbs2() + x.im.cwiseAbs2());
    };
    const Eigen::MatrixXd left_power = power(left);
    const Eigen::MatrixXd right_power = power(right);
    for (std::size_t p = 0; p < pairs.size(); ++p)
      for (Eigen::Index m = 0; m < W.rows(); ++m) {
        EXPECT_NEAR(sums(p, m), wanted(p, m),
                    1e-9 * std::sqrt(left_power(m, pairs[p].left) * right_power(m, pairs[p].right)))
            << pairs[p].left << " with " << pairs[p].right;
      }
  }
};

TEST_F(ReductionTest, SumsOfProductsFollowFromSumsOfFractions) {
  for (const HoldModel hold : kHolds) {
    SCOPED_TRACE(to_string(hold));
    const Case c(hold);
    const BasisGroup& g = c.group;
    expect_sums(c, g.fractions.F, g.F, g.fractions.F, g.F, 20);
    expect_sums(c, g.fractions.F, g.F, g.fractions.D, g.D, 40);
    expect_sums(c, g.fractions.D, g.D, g.fractions.D, g.D, 60);
  }
}

TEST_F(ReductionTest, WithComplexWeightsToo) {
  for (const HoldModel hold : kHolds) {
    SCOPED_TRACE(to_string(hold));
    const Case c(hold);
    const FractionColumns& fractions = c.group.fractions;
    const auto pairs = all_pairs(std::ssize(fractions.F), std::ssize(fractions.Y));
    const PairReduction reduction(fractions, fractions.F, fractions.Y, pairs);
    EXPECT_GE(pairs.size() - reduction.direct().size(), 20U);
    const SplitMatrix& F = c.group.F;
    const Eigen::MatrixXd V_re = c.fit.G->real();
    const Eigen::MatrixXd V_im = c.fit.G->imag();
    const auto sums_of = [&](const std::vector<ColumnPair>& some) {
      Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(std::ssize(some), V_re.rows());
      add_pair_sums(V_re, V_im, F, c.Y, some, 0, sums);
      return sums;
    };
    const auto re = fractions.first.re.col(0).asDiagonal();
    const auto im = fractions.first.im.col(0).asDiagonal();
    const auto base = fractions.base->leftCols(fractions.simple_columns());
    const Eigen::MatrixXd S_re = (V_re * re + V_im * im) * base;
    const Eigen::MatrixXd S_im = (V_im * re - V_re * im) * base;
    const Eigen::MatrixXd size = V_re.cwiseAbs2() + V_im.cwiseAbs2();
    expect_close(pairs, sums_of(pairs),
                 reduction.expand(S_re, S_im, sums_of(reduction.direct()), 2), size.cwiseSqrt(), F,
                 c.Y);
  }
}

TEST_F(ReductionTest, WhatWouldCancelIsMultipliedOut) {
  const double highest_rad_s = 2.0 * std::numbers::pi * 2000.0;
  const HoldEquivalent through(
      {Eigen::VectorXd::LinSpaced(50, 100.0, highest_rad_s), 1e-4, HoldModel::exact}, 1.3e-4);
  std::vector<SubmodelShape> shapes;
  std::vector<Eigen::VectorXd> a;
  for (const double hz : {3.0, 4.0, 800.0, 801.0, 1500.0}) {
    const std::vector<double> coefficients = test::mode_coefficients(hz, 0.01);
    shapes.push_back({0, 2, 0});
    a.emplace_back(Eigen::Map<const Eigen::VectorXd>(coefficients.data(), 2));
  }
  const FractionColumns fractions = fraction_columns(through, highest_rad_s, shapes, a, true);
  const auto is_direct = [&](Eigen::Index left, Eigen::Index right) {
    return !PairReduction(fractions, fractions.D, fractions.D, {{2 * left, 2 * right}})
                .direct()
                .empty();
  };
  for (Eigen::Index mode = 0; mode < 4; ++mode) EXPECT_TRUE(is_direct(mode, mode));
  EXPECT_TRUE(is_direct(2, 3));  // they overlap
  EXPECT_TRUE(is_direct(0, 1));  // both far below the highest line
  EXPECT_FALSE(is_direct(2, 4));
  EXPECT_FALSE(is_direct(3, 4));
}

}  // namespace stageid::test_pair_reduction
