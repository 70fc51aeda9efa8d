#include "frf/runs/excitation_spectrum.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "tests/support/stages/closed_loop.hpp"

namespace stageid::test_excitation_spectrum {

constexpr int kPeriod = 4000;
const std::vector<int> kOddLines = test::line_range(1, 799, 2);

Eigen::MatrixXd multisine(const Eigen::VectorXd& amplitude) {
  test::ComplexNoise random(9);
  Eigen::MatrixXcd spectrum(1, amplitude.size());
  for (Eigen::Index k = 0; k < spectrum.cols(); ++k) spectrum(0, k) = amplitude[k] * random.phase();
  RealDft dft(kPeriod);
  return test::synthesize(spectrum, kOddLines, dft);
}

TEST(ExcitationSpectrum, FindsLinesChannelsAndCoefficients) {
  RealDft dft(kPeriod);
  Eigen::MatrixXd period = Eigen::MatrixXd::Zero(kPeriod, 3);
  period.col(1) = multisine(Eigen::VectorXd::Constant(400, 2.0));
  period.col(2).setConstant(4.0);  // an offset is not an excitation
  const ExcitationSpectrum found = excitation_spectrum(period, dft);
  EXPECT_EQ(found.lines, kOddLines);
  EXPECT_EQ(found.channels, std::vector<Eigen::Index>{1});
  EXPECT_LT((found.values.row(1).cwiseAbs().array() - 2.0).abs().maxCoeff(), 1e-11);
  EXPECT_EQ(found.values.row(0).norm(), 0.0);
  const ExcitationSpectrum none = excitation_spectrum(Eigen::MatrixXd::Zero(kPeriod, 2), dft);
  EXPECT_TRUE(none.lines.empty());
  EXPECT_TRUE(none.channels.empty());
}

// The sign of the exponent: a cosine with a lead of 90 degrees (cos(x + pi/2)) has the coefficient +j/2.
TEST(ExcitationSpectrum, APhaseLeadIsAPositiveAngle) {
  RealDft dft(kPeriod);
  Eigen::MatrixXd period(kPeriod, 1);
  for (Eigen::Index n = 0; n < kPeriod; ++n) {
    period(n, 0) = std::cos(2.0 * std::numbers::pi * 7.0 * static_cast<double>(n) / kPeriod +
                            0.5 * std::numbers::pi);
  }
  const ExcitationSpectrum found = excitation_spectrum(period, dft);
  ASSERT_EQ(found.lines, std::vector<int>{7});
  EXPECT_LT(std::abs(found.values(0, 0) - std::complex<double>(0.0, 0.5)), 1e-12);
}

TEST(ExcitationSpectrum, ShapedSpectraKeepTheirWeakLines) {
  Eigen::VectorXd amplitude(400);
  for (Eigen::Index k = 0; k < 400; ++k)
    amplitude[k] = std::pow(10.0, -5.0 * static_cast<double>(k) / 400.0);
  RealDft dft(kPeriod);
  EXPECT_EQ(excitation_spectrum(multisine(amplitude), dft).lines, kOddLines);
  // The same for float32: rounding is 6e-8 of a sample.
  const Eigen::MatrixXd single = multisine(amplitude).cast<float>().cast<double>();
  EXPECT_EQ(excitation_spectrum(single, dft).lines, kOddLines);
}

TEST(ExcitationSpectrum, TheRoundingOfSamplesIsNoExcitation) {
  RealDft dft(kPeriod);
  const Eigen::MatrixXd exact = multisine(Eigen::VectorXd::Ones(400));
  for (const double full_scale : {2047.0, 32767.0, 8388607.0}) {
    const double step = exact.cwiseAbs().maxCoeff() / full_scale;
    const Eigen::MatrixXd coded = (exact / step).array().round().matrix() * step;
    EXPECT_EQ(excitation_spectrum(coded, dft).lines, kOddLines) << full_scale;
  }
  for (const int digits : {3, 4, 5, 6, 7})
    for (const double unit : {1.0, 1e-3}) {
      const Eigen::MatrixXd written = exact.unaryExpr([digits](double value) {
        return std::strtod(fmt::format("{:.{}g}", value, digits).c_str(), nullptr);
      });
      EXPECT_EQ(excitation_spectrum(unit * written, dft).lines, kOddLines) << digits;
    }
}

TEST(ExcitationSpectrum, ABinarySequenceExcitesItsLinesThoughItsStepIsLarge) {
  test::ComplexNoise random(3);
  RealDft dft(kPeriod);
  Eigen::MatrixXd period(kPeriod, 1);
  for (Eigen::Index n = 0; n < kPeriod; ++n) period(n, 0) = random.uniform() < 0.5 ? -1.0 : 1.0;
  EXPECT_GT(excitation_spectrum(period, dft).lines.size(), 1990U);
}

}  // namespace stageid::test_excitation_spectrum
