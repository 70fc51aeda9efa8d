// Whether a fit without options reports the deviations that its modes have, on data for which that is hard.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "estimation/request/fit_request.hpp"
#include "tests/support/models/model_fit_problem.hpp"

namespace stageid::test_honest_deviations {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr int kOutputs = 3;
constexpr int kInputs = 4;
constexpr double kNoise = 3e-3;  // of the median magnitude

using Noise = std::function<Eigen::MatrixXcd(test::RandomNumbers& random, Eigen::Index lines)>;

Eigen::MatrixXcd white(test::RandomNumbers& random, Eigen::Index lines) {
  return test::circular_matrix(random, kOutputs * kInputs, lines);
}

/// Six modes; numerators B_0 (1 + general r s / omega) with random r of each entry.
test::DenseProblem plant(double general) {
  test::RandomNumbers random(5);
  test::DenseProblem out;
  out.model = test::named_model(kOutputs, kInputs);
  out.frequency_hz = Eigen::VectorXd::LinSpaced(750, 30.0, 779.0);
  for (const double f : {95.0, 150.0, 310.0, 335.0, 520.0, 660.0}) {
    Submodel& s = out.model.submodels.emplace_back(test::empty_mode(out.model, f, 0.01, 2));
    for (Eigen::Index c = 0; c < s.numerator[0].size(); ++c) {
      const double B = s.denominator[2] * random.normal();
      s.numerator[0].reshaped()[c] = B;
      s.numerator[1].reshaped()[c] = B * general * random.normal() * std::sqrt(s.denominator[2]);
    }
  }
  test::measure(out);
  return out;
}

FrfEstimate measured(const test::DenseProblem& plant, std::uint64_t seed, const Noise& noise) {
  test::RandomNumbers random(seed);
  FrfEstimate frf = test::frf_of(plant);
  const double deviation = kNoise * test::median_of(plant.G.cwiseAbs().reshaped());
  frf.response += deviation * noise(random, frf.lines());
  frf.noise_variance.setConstant(frf.response.rows(), frf.lines(), deviation * deviation);
  return frf;
}

/// rms of the errors of the natural frequencies in reported deviations over six fits.
double errors_in_deviations(const test::DenseProblem& plant, const Noise& noise,
                            bool with_variances = true) {
  double squares = 0.0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    FrfEstimate frf = measured(plant, 40 + seed, noise);
    if (!with_variances) frf.noise_variance.resize(0, 0);
    const FitResult fit = fit_model(frf);
    EXPECT_TRUE(fit.trustworthy()) << fit.message();
    EXPECT_EQ(std::ranges::count_if(fit.model.submodels, &Submodel::is_mode), 6);
    for (const Submodel& truth : plant.model.submodels) {
      const double f = truth.natural_frequency_hz();
      const auto distance = [f](const Submodel& s) {
        return s.is_mode() ? std::abs(s.natural_frequency_hz() - f) : HUGE_VAL;
      };
      const Submodel& mode = *std::ranges::min_element(fit.model.submodels, {}, distance);
      squares += std::pow(distance(mode) / mode.natural_frequency_std_hz.value(), 2);
      ++count;
    }
  }
  return std::sqrt(squares / count);
}

// Hundreds of parameters that are small, but shift the modes by several deviations if they are left out.
TEST(HonestDeviations, WithSlightlyGeneralDamping) {
  EXPECT_LT(errors_in_deviations(plant(7e-5), white), 1.25);
}

// As of lines that were smoothed.
TEST(HonestDeviations, WithNoiseThatIsAlikeOnNeighbouringLines) {
  const Noise alike = [](test::RandomNumbers& random, Eigen::Index lines) {
    const Eigen::MatrixXcd more = white(random, lines + 4);
    Eigen::MatrixXcd out = Eigen::MatrixXcd::Zero(more.rows(), lines);
    for (Eigen::Index i = 0; i < 5; ++i) out += more.middleCols(i, lines) / std::sqrt(5.0);
    return out;
  };
  EXPECT_NEAR(errors_in_deviations(plant(0.0), alike), 1.0, 0.35);
  EXPECT_THAT(fit_model(measured(plant(0.0), 3, alike)).decisions,
              Contains(HasSubstr("alike on neighbouring lines")));
}

TEST(HonestDeviations, WithoutVariances) {
  EXPECT_NEAR(errors_in_deviations(plant(0.0), white, false), 1.0, 0.35);
}

// As of a recorder with the other sign of time: no model with stable poles fits, and that is the reason to name.
TEST(HonestDeviations, AConjugateResponseIsNamed) {
  FrfEstimate frf = measured(plant(0.0), 1, white);
  frf.response = frf.response.conjugate().eval();
  const FitResult fit = fit_model(frf);
  EXPECT_FALSE(fit.trustworthy());
  EXPECT_THAT(fit.message(), HasSubstr("complex conjugate"));
}

TEST(HonestDeviations, TooLargeVariancesAreTold) {
  FrfEstimate frf = measured(plant(0.0), 1, white);
  EXPECT_THAT(fit_model(frf).findings, Not(Contains(HasSubstr("too large"))));
  frf.noise_variance *= 10.0;
  EXPECT_THAT(fit_model(frf).findings, Contains(HasSubstr("about 3.2 times too large")));
}

// A response without a hold whose file says that there was one.
TEST(HonestDeviations, ANegativeDelayIsTold) {
  FrfEstimate frf = measured(plant(0.0), 1, white);
  frf.sample_rate_hz = 20000.0;
  frf.hold = Hold::zoh;
  EXPECT_THAT(fit_model(frf).findings, Contains(HasSubstr("the delay is negative, -25")));
}

}  // namespace stageid::test_honest_deviations
