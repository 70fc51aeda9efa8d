// The equations of a pole relocation against the same written out densely.

#include "estimation/equations/sigma_equations.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>

#include "estimation/products/fraction_gram.hpp"
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

TEST_P(OnBothAxes, ProductsOfFractionsAreTheirSums) {
  const Case c = a_case(GetParam(), 40);
  test::RandomNumbers random(7);
  Eigen::VectorXcd v(40);
  for (Complex& value : v) value = random.circular();
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
  Eigen::MatrixXcd H(kChannels, kLines);
  for (Complex& value : H.reshaped()) value = random.circular();
  Eigen::MatrixXd W(kChannels, kLines);
  for (double& value : W.reshaped()) value = std::norm(random.circular()) + 0.1;
  SplitMatrix own{Eigen::MatrixXd::Ones(kLines, 1), Eigen::MatrixXd::Zero(kLines, 1)};
  const Eigen::MatrixXcd phi = complex(partial_fractions(c.poles, c.x));
  Eigen::MatrixXd left_over = Eigen::MatrixXd::Zero(6, 6);
  for (Eigen::Index i = 0; i < kChannels; ++i) {
    Eigen::MatrixXcd left(kLines, 6);
    left << phi, Eigen::VectorXcd::Ones(kLines);
    const Eigen::VectorXd root = W.row(i).cwiseSqrt().transpose();
    Eigen::MatrixXcd right = -(H.row(i).transpose().asDiagonal() * left);
    left = root.asDiagonal() * left;
    right = root.asDiagonal() * right;
    Eigen::MatrixXd A(2 * kLines, 6);
    A << left.real(), left.imag();
    Eigen::MatrixXd B(2 * kLines, 6);
    B << right.real(), right.imag();
    const Eigen::MatrixXd E = B - A * A.colPivHouseholderQr().solve(B);
    left_over += E.transpose() * E;
  }
  const Eigen::VectorXcd factor = Eigen::VectorXcd::Constant(c.x.size(), Complex(1.2, -1.6));
  const Eigen::MatrixXcd G = H * factor.asDiagonal();
  const Eigen::MatrixXd of_G = 0.25 * W;
  const SigmaEquations equations(c.x, c.unit_circle, G, factor, of_G, own, 1);
  for (const bool accurate : {true, false}) {
    const Eigen::MatrixXd R = equations.triangle(c.poles, accurate);
    EXPECT_LT((R.transpose() * R - left_over).norm(), 1e-10 * left_over.norm()) << accurate;
    EXPECT_EQ(
        equations.triangle(c.poles, accurate),
        SigmaEquations(c.x, c.unit_circle, G, factor, of_G, own, 3).triangle(c.poles, accurate));
  }
}

// With the true poles numerators alone leave nothing, on all lines or on some.
TEST_P(OnBothAxes, TheLastColumnIsTheResidualOfThePoles) {
  const Case c = a_case(GetParam(), 100);
  const Eigen::MatrixXcd phi = complex(partial_fractions(c.poles, c.x));
  Eigen::VectorXd numerators(5);
  numerators << 1.0, -0.4, 0.3, 0.9, -2.0;
  const Eigen::MatrixXcd H = (phi * numerators).transpose();
  SplitMatrix own{Eigen::MatrixXd::Ones(100, 1), Eigen::MatrixXd::Zero(100, 1)};
  const Eigen::MatrixXd W = H.cwiseAbs2().cwiseInverse();
  const Eigen::VectorXcd factor = Eigen::VectorXcd::Constant(c.x.size(), Complex(1.2, -1.6));
  const Eigen::MatrixXcd G = H * factor.asDiagonal();
  const Eigen::MatrixXd of_G = 0.25 * W;
  const SigmaEquations equations(c.x, c.unit_circle, G, factor, of_G, own, 1);
  EXPECT_LT(equations.triangle(c.poles, true).col(5).norm(), 1e-12 * 10.0);
  PoleSet off = c.poles;
  off.pairs[1] *= 1.01;
  // A fifth of the lines is used; the norm is scaled to that of all.
  const double some = equations.triangle(off, true).col(5).norm();
  const double all = equations.triangle(off, false).col(5).norm();
  EXPECT_NEAR(some, all, 0.2 * all);
}

INSTANTIATE_TEST_SUITE_P(Axes, OnBothAxes, testing::Bool(), [](const auto& instance) {
  return instance.param ? "circle" : "imaginary";
});

}  // namespace stageid::test_sigma_equations
