// The equations of a pole relocation against the same written out densely.

#include "estimation/equations/sigma_equations.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/products/fraction_gram.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_sigma_equations {

using Complex = std::complex<double>;

struct Case {
  PoleSet poles;
  Eigen::VectorXcd x;
  bool unit_circle = false;
};

/// Two pairs, one of them sharp, and a real pole.
Case a_case(bool unit_circle, Eigen::Index lines) {
  Case out{{{{-0.02, 2.0}, {-0.3, 5.0}}, {-4.0}}, Eigen::VectorXcd(lines), unit_circle};
  const double T = 0.3;
  for (Eigen::Index k = 0; k < lines; ++k) {
    const Complex s(0.0, 0.1 + 8.0 * static_cast<double>(k) / static_cast<double>(lines));
    out.x[k] = unit_circle ? std::exp(s * T) : s;
  }
  if (!unit_circle) return out;
  for (Complex& p : out.poles.pairs) p = std::exp(p * T);
  for (double& p : out.poles.reals) p = std::exp(p * T);
  return out;
}

Eigen::MatrixXcd complex(const SplitMatrix& X) {
  return X.re.cast<Complex>() + Complex(0.0, 1.0) * X.im.cast<Complex>();
}

class OnBothAxes : public testing::TestWithParam<bool> {};

/// Of responses H with weights W behind a factor on every line, and one numerator beside the fractions.
Eigen::MatrixXd triangle(const Case& c, const Eigen::MatrixXcd& H, const Eigen::MatrixXd& W,
                         const PoleSet& poles, bool accurate, int threads = 1) {
  const Eigen::VectorXcd factor = Eigen::VectorXcd::Constant(c.x.size(), Complex(1.2, -1.6));
  const Eigen::MatrixXcd G = H * factor.asDiagonal();
  const Eigen::MatrixXd of_G = 0.25 * W;
  const SplitMatrix own{Eigen::MatrixXd::Ones(c.x.size(), 1), Eigen::MatrixXd::Zero(c.x.size(), 1)};
  return SigmaEquations(c.x, c.unit_circle, G, factor, of_G, own, threads)
      .triangle(poles, accurate);
}

TEST_P(OnBothAxes, ProductsOfFractionsAreTheirSums) {
  const Case c = a_case(GetParam(), 40);
  test::RandomNumbers random(7);
  const Eigen::VectorXcd v = test::circular_matrix(random, 40, 1);
  const Eigen::MatrixXcd phi = complex(partial_fractions(c.poles, c.x));
  const Eigen::MatrixXd dense = (phi.adjoint() * v.asDiagonal() * phi).real();
  const Eigen::MatrixXd sums = FractionGram(c.poles, c.x, c.unit_circle)(v);
  EXPECT_LT((sums - dense).norm(), 1e-12 * dense.norm());
}

TEST_P(OnBothAxes, TheTriangleIsWhatIsLeftOfTheDenseEquations) {
  constexpr Eigen::Index kLines = 18;  // too few to leave any out
  constexpr Eigen::Index kChannels = 3;
  const Case c = a_case(GetParam(), kLines);
  test::RandomNumbers random(11);
  const Eigen::MatrixXcd H = test::circular_matrix(random, kChannels, kLines);
  const Eigen::MatrixXd W =
      test::circular_matrix(random, kChannels, kLines).cwiseAbs2().array() + 0.1;
  Eigen::MatrixXcd left(kLines, 6);
  left << complex(partial_fractions(c.poles, c.x)), Eigen::VectorXcd::Ones(kLines);
  Eigen::MatrixXd left_over = Eigen::MatrixXd::Zero(6, 6);
  for (Eigen::Index i = 0; i < kChannels; ++i) {
    Eigen::MatrixXd A(2 * kLines, 6);
    Eigen::MatrixXd B(2 * kLines, 6);
    for (Eigen::Index k = 0; k < kLines; ++k) {
      const Eigen::RowVectorXcd row = std::sqrt(W(i, k)) * left.row(k);
      const Eigen::RowVectorXcd other = -H(i, k) * row;
      A.row(k) = row.real();
      A.row(kLines + k) = row.imag();
      B.row(k) = other.real();
      B.row(kLines + k) = other.imag();
    }
    const auto factors = pivoted_qr(A);
    Eigen::MatrixXd E(2 * kLines, 6);
    for (Eigen::Index p = 0; p < 6; ++p) E.col(p) = B.col(p) - A * least_squares(factors, B.col(p));
    left_over += E.transpose() * E;
  }
  for (const bool accurate : {true, false}) {
    const Eigen::MatrixXd R = triangle(c, H, W, c.poles, accurate);
    EXPECT_LT((R.transpose() * R - left_over).norm(), 1e-10 * left_over.norm()) << accurate;
    EXPECT_EQ(R, triangle(c, H, W, c.poles, accurate, 3));
  }
}

// With the true poles numerators alone leave nothing, on all lines or on some.
TEST_P(OnBothAxes, TheLastColumnIsTheResidualOfThePoles) {
  const Case c = a_case(GetParam(), 100);
  const Eigen::VectorXcd numerators{{1.0, -0.4, 0.3, 0.9, -2.0}};
  const Eigen::MatrixXcd H = (complex(partial_fractions(c.poles, c.x)) * numerators).transpose();
  const Eigen::MatrixXd W = H.cwiseAbs2().cwiseInverse();
  EXPECT_LT(triangle(c, H, W, c.poles, true).col(5).norm(), 1e-12 * 10.0);
  PoleSet off = c.poles;
  off.pairs[1] *= 1.01;
  // A fifth of the lines is used; the norm is scaled to that of all.
  const double some = triangle(c, H, W, off, true).col(5).norm();
  const double all = triangle(c, H, W, off, false).col(5).norm();
  EXPECT_NEAR(some, all, 0.2 * all);
}

INSTANTIATE_TEST_SUITE_P(Axes, OnBothAxes, testing::Bool(), [](const auto& instance) {
  return instance.param ? "circle" : "imaginary";
});

}  // namespace stageid::test_sigma_equations
