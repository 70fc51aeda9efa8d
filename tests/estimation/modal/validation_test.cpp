#include "estimation/modal/validation.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "tests/estimation/noisy_stage.hpp"
#include "tests/support/models/divided_frf.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/thread_team.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test_validation {

using testing::HasSubstr;

AdditiveModel stage_model(HoldModel hold) {
  test::RandomNumbers random(6);
  AdditiveModel model =
      test::stage_2x3(HoldModel::exact, random, {{300.0, 0.02}, {950.0, 0.01}}).model;
  model.hold = hold;
  return model;
}

FrfEstimate measured(const AdditiveModel& model, HoldModel hold) {
  test::DenseProblem problem{model, Eigen::VectorXd::LinSpaced(1500, 20.0, 2000.0), hold, {}, {}};
  test::measure(problem);
  return test::frf_of(problem);
}

/// A stage, and its response through the exact hold.
struct ValidationOfAStage : testing::Test {
  AdditiveModel model = stage_model(HoldModel::exact);
  FrfEstimate frf = measured(model, HoldModel::exact);
};
using ResponseLike = ValidationOfAStage;

/// Adds noise of the variance in the FRF, or of `factor` times it.
void add_noise(FrfEstimate& frf, std::uint64_t seed, double factor = 1.0) {
  test::RandomNumbers random(seed);
  frf.noise_variance = factor * 1e-4 * frf.response.cwiseAbs2();
  test::add_noise(frf, random);
  frf.noise_variance /= factor;
}

/// Makes the variances those of so many degrees of freedom.
void scatter_variances(FrfEstimate& frf, std::uint64_t seed, int dof) {
  test::RandomNumbers random(seed);
  for (double& variance : frf.noise_variance.reshaped()) variance *= random.chi_square_mean(dof);
  frf.noise_dof = dof;
}

TEST_F(ValidationOfAStage, ATrueModelIsWithinTheNoise) {
  int too_coloured = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    FrfEstimate noisy = frf;
    add_noise(noisy, seed);
    const Validation result = validate(model, noisy);
    const double values = 6.0 * 1500.0;
    // |e|^2 is Exp(1): mean 1 and deviation 1 each.
    EXPECT_NEAR(result.chi_square_per_dof, 1.0, 4.5 / std::sqrt(values));
    EXPECT_NEAR(result.whitened_above_95, 0.05, 4.5 * std::sqrt(0.05 * 0.95 / values));
    EXPECT_NEAR(result.relative_rms_error, 0.01, 0.01 * 4.5 * 0.5 / std::sqrt(values) + 1e-6);
    EXPECT_GT(result.whiteness, 0.0);
    EXPECT_LT(result.whiteness_limit, 0.05);
    if (result.whiteness > result.whiteness_limit) ++too_coloured;
  }
  // A 99 % limit: 0.4 of 40 are expected above it, more than 4 have a probability below 1e-4.
  EXPECT_LE(too_coloured, 4);
}

// Variances from few degrees of freedom: |e|^2 over them is F(2, 2 nu).
TEST_F(ValidationOfAStage, CountsWhatVariancesFromFewDegreesOfFreedomExceed) {
  add_noise(frf, 71);
  scatter_variances(frf, 72, 4);
  const Validation result = validate(model, frf);
  EXPECT_NEAR(result.whitened_above_95, 0.05, 4.5 * std::sqrt(0.05 * 0.95 / 9000.0));
  frf.noise_dof = 0.0;  // taken for exact
  EXPECT_GT(validate(model, frf).whitened_above_95, 0.09);
}

/// A gain per output.
AdditiveModel constant_model(const Eigen::VectorXd& gain) {
  AdditiveModel model = test::named_model(static_cast<int>(gain.size()), 1);
  model.submodels = {test::empty_submodel(model, 0, {}, 1)};
  model.submodels[0].numerator[0] = gain;
  return model;
}

// The limit is 99 %, not 99.9999 %: of many white residuals some are above it.
TEST(Validation, TheWhitenessLimitIsTheOneItSays) {
  const AdditiveModel model = constant_model(Eigen::VectorXd::Ones(1));
  FrfEstimate frf = test::frf_of({model,
                                  Eigen::VectorXd::LinSpaced(200, 1.0, 200.0),
                                  HoldModel::none,
                                  Eigen::MatrixXcd::Ones(1, 200),
                                  {}});
  frf.noise_variance = Eigen::MatrixXd::Constant(1, 200, 0.01);
  int above = 0;
  constexpr int kRuns = 2000;
  for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
    test::RandomNumbers random(seed);
    frf.response.setOnes();
    test::add_noise(frf, random);
    const Validation result = validate(model, frf);
    if (result.whiteness > result.whiteness_limit) ++above;
  }
  // 20 expected; the limit takes all lags alike, of which the longer ones sum fewer lines.
  EXPECT_GE(above, 5);
  EXPECT_LE(above, 40);
}

TEST_F(ValidationOfAStage, AModelThatIsWrongShowsInEveryFigure) {
  add_noise(frf, 3);
  AdditiveModel wrong = model;
  const std::vector<double> a = test::mode_coefficients(303.0, 0.02);
  wrong.submodels[1].denominator = {1.0, a[0], a[1]};
  const Validation result = validate(wrong, frf);
  EXPECT_GT(result.chi_square_per_dof, 2.0);
  EXPECT_GT(result.whitened_above_95, 0.1);
  EXPECT_GT(result.whiteness, 5.0 * result.whiteness_limit);
  EXPECT_GT(result.relative_rms_error, 0.02);
}

// One realization: the lines scatter by more than the variance from periods, about a smooth response.
TEST_F(ValidationOfAStage, ScatterOfTheLinesExplainsWhatTheNoiseDoesNot) {
  add_noise(frf, 4, 4.0);
  const Validation result = validate(model, frf);
  EXPECT_TRUE(result.explained) << result.reason;
  EXPECT_EQ(result.variance, ResidualVariance::scatter);
  EXPECT_NEAR(result.chi_square_per_dof, result.expected_chi_square, 0.15);
  EXPECT_LT(result.whiteness, result.whiteness_limit * 1.5);
}

// With too few lines for a scatter, only the noise is known.
TEST_F(ValidationOfAStage, NoiseThatIsLargerThanToldShowsInChiSquare) {
  add_noise(frf, 4, 25.0);
  frf = select_band(std::move(frf), 600.0, 625.0);
  const Validation result = validate(model, frf);
  EXPECT_FALSE(result.explained);
  EXPECT_EQ(result.variance, ResidualVariance::noise);
  EXPECT_NEAR(result.chi_square_per_dof, 25.0, 25.0 * 4.5 / std::sqrt(6.0 * 18.0));
}

TEST(Validation, ErrorsAreThoseOfTheirDefinitions) {
  const AdditiveModel model = constant_model(Eigen::VectorXd{{1.0, 2.0}});
  const Eigen::MatrixXcd G{{2.0, std::complex<double>(1.0, 1.0)},
                           {4.0, 0.0}};  // a zero has no relative error
  const Validation result =
      validate(model, test::frf_of({model, Eigen::VectorXd{{1.0, 2.0}}, HoldModel::none, G, {}}));
  // |E|^2 = 1, 1; 4, 4.  |G|^2 = 4, 2; 16, 0.
  EXPECT_NEAR(result.relative_rms_error, std::sqrt((0.25 + 0.5 + 0.25) / 3.0), 1e-15);
  EXPECT_NEAR(result.normalized_error, std::sqrt(10.0 / 22.0), 1e-15);
  ASSERT_EQ(result.channel_error.size(), 2);
  EXPECT_NEAR(result.channel_error[0], std::sqrt(0.375), 1e-15);
  EXPECT_EQ(result.chi_square_per_dof, 0.0) << "unknown without variances";
  EXPECT_EQ(result.whiteness_limit, 0.0);
}

TEST_F(ValidationOfAStage, TotalVarianceServesWhereNoNoiseVarianceIs) {
  add_noise(frf, 5);
  frf.total_variance = frf.noise_variance;
  frf.noise_variance.resize(0, 0);
  EXPECT_NEAR(validate(model, frf).chi_square_per_dof, 1.0, 0.06);
}

// A plant so nonlinear that its realizations differ by more than the response: distortion alone would explain any model.
TEST_F(ValidationOfAStage, AModelThatIsWorseThanNoneIsNotExplained) {
  frf.total_variance = 4.0 * frf.response.cwiseAbs2();
  frf.realizations = 3;
  EXPECT_TRUE(validate(model, frf).explained);
  for (Submodel& s : model.submodels)
    for (Eigen::MatrixXd& numerator : s.numerator) numerator *= -0.3;
  const Validation result = validate(model, frf);
  EXPECT_NEAR(result.normalized_error, 1.3, 1e-9);
  EXPECT_FALSE(result.explained);
  EXPECT_THAT(result.reason, HasSubstr("worse than none"));
}

// A variance that is itself the mean of nu squares: the ratio is F(2, 2 nu).
TEST_F(ValidationOfAStage, FewPeriodsRaiseTheChiSquareOfNoiseAlone) {
  EXPECT_EQ(validate(model, frf).expected_chi_square, 9.0 / 8.0)
      << "without variances: of the scatter of twelve lines about three terms";
  for (const int nu : {4, 9}) {
    FrfEstimate noisy = frf;
    add_noise(noisy, 7);
    EXPECT_EQ(validate(model, noisy).expected_chi_square, 1.0) << "exact variances";
    scatter_variances(noisy, static_cast<std::uint64_t>(nu), nu);
    const Validation result = validate(model, noisy);
    EXPECT_DOUBLE_EQ(result.expected_chi_square, nu / (nu - 1.0));
    // F(2, 2 nu) has the variance nu^3 / ((nu - 1)^2 (nu - 2)).
    const double deviation = std::sqrt(std::pow(nu, 3) / (std::pow(nu - 1, 2) * (nu - 2)));
    EXPECT_NEAR(result.chi_square_per_dof, result.expected_chi_square,
                4.5 * deviation / std::sqrt(9000.0));
  }
  add_noise(frf, 7);
  frf.noise_dof = 1.0;
  EXPECT_EQ(validate(model, frf).expected_chi_square, 0.0) << "no mean";
}

TEST_F(ValidationOfAStage, ChannelsMustMatchByNameAndUnit) {
  const auto refusal = [this] {
    return test::error_message<std::invalid_argument>([this] { validate(model, frf); });
  };
  model.outputs.units = {"m", "m"};
  frf.outputs.units = {"m", ""};  // unknown: nothing is said against it
  EXPECT_EQ(refusal(), "no error");
  frf.outputs.units = {"m", "mm"};
  EXPECT_THAT(refusal(), HasSubstr(model.outputs.names[1] + " is in m in the model"));
  frf.inputs.names[1] = "other";
  EXPECT_THAT(refusal(), HasSubstr("different channels"));
  frf.inputs.names[1] = model.inputs.names[1];
  std::swap(frf.outputs.names[0], frf.outputs.names[1]);
  EXPECT_THAT(refusal(), HasSubstr("different channels"));
  std::swap(frf.outputs.names[0], frf.outputs.names[1]);
  frf = select_channels(frf, {"a1", "a2"}, {"z1", "z2"});
  EXPECT_THAT(refusal(), HasSubstr("different channels"));
}

/// Largest relative difference of two responses.
double distance(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b) {
  return ((a - b).cwiseAbs().array() / b.cwiseAbs().array()).maxCoeff();
}

TEST_F(ResponseLike, SampledDataAreComparedThroughHoldAndDelayOfTheSampleRate) {
  EXPECT_LT(distance(response_like(model, frf),
                     test::reference_response(model, frf.frequency_hz, HoldModel::exact)),
            1e-9);
  model.sample_rate_hz = 0.0;
  EXPECT_THROW((void)response_like(model, frf), std::invalid_argument);
}

TEST_F(ResponseLike, ContinuousDataAreComparedWithoutThem) {
  AdditiveModel bare = model;
  bare.input_delay_s.setZero();
  frf = measured(bare, HoldModel::none);
  EXPECT_LT(distance(response_like(model, frf), frf.response), 1e-12);
  // A model that was fitted to such data with a delay keeps it.
  AdditiveModel continuous = model;
  continuous.hold = HoldModel::none;
  frf = measured(continuous, HoldModel::none);
  EXPECT_LT(distance(response_like(continuous, frf), frf.response), 1e-12);
}

TEST_F(ResponseLike, DataThatHaveLostHoldAndDelayMeetAModelThatLosesThemToo) {
  frf.delay_s = 1.1e-4;  // not quite the model's
  const double T = 1e-4;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const std::complex<double> s(0.0, 2.0 * std::numbers::pi * frf.frequency_hz[k]);
    frf.response.col(k) /= std::exp(-s * frf.delay_s) * (1.0 - std::exp(-s * T)) / (s * T);
  }
  frf.compensated = Compensation::hold;
  EXPECT_LT(distance(response_like(model, frf), frf.response), 1e-9);
}

// Hold level "phase": e^{-j omega (delay_s + T/2)} is divided out, the magnitude is unchanged.
TEST_F(ResponseLike, DataThatHaveLostTheirDelayMeetAModelThatLosesItToo) {
  frf.delay_s = 1.1e-4;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const std::complex<double> s(0.0, 2.0 * std::numbers::pi * frf.frequency_hz[k]);
    frf.response.col(k) /= std::exp(-s * (frf.delay_s + 0.5e-4));
  }
  frf.compensated = Compensation::delay;
  EXPECT_LT(distance(response_like(model, frf), frf.response), 1e-9);
}

TEST_F(ResponseLike, AContinuousModelOfCompensatedDataIsTakenAsItIs) {
  model = stage_model(HoldModel::none);
  frf = measured(model, HoldModel::none);
  frf.hold = Hold::zoh;
  frf.compensated = Compensation::hold;
  EXPECT_LT(distance(response_like(model, frf), frf.response), 1e-12);
}

TEST_F(ValidationOfAStage, AChannelOfNoiseDoesNotDecideTheRelativeError) {
  add_noise(frf, 5);
  frf.noise_dof = 8.0;
  AdditiveModel decoupled = model;
  for (Submodel& s : decoupled.submodels) s.numerator[0](1, 2) = 0.0;
  test::RandomNumbers random(7);
  for (std::complex<double>& value : frf.response.row(5)) value = 1e-12 * random.circular();
  frf.noise_variance.row(5).setConstant(1e-24);
  const Validation result = validate(decoupled, frf);
  EXPECT_NEAR(result.relative_rms_error, 0.01, 0.001);
  EXPECT_TRUE(std::isnan(result.channel_error[5]));
  EXPECT_NEAR(result.channel_error[0], 0.01, 0.002);
}

/// More channels than two tiles. Without variances, with noise, and with the scatter of the lines instead of it.
TEST(Validation, IsTheSameInEveryTeam) {
  const test::RandomStage stage = test::draw_random_stage(
      3, {.outputs = 300, .inputs = 2, .least_modes = 4, .most_modes = 4, .line_spacing_hz = 8.0});
  FrfEstimate without = stage.frf;
  without.noise_variance.resize(0, 0);
  FrfEstimate distorted = stage.frf;
  distorted.noise_variance *= 0.01;
  for (const FrfEstimate& frf : {stage.frf, without, distorted}) {
    const Validation alone = validate(stage.truth, frf);
    for (const int size : {2, 4})
      test::run_team(size, [&](const Team& team) {
        const Validation shared = validate(stage.truth, test::divided(frf, team));
        EXPECT_EQ(shared.relative_rms_error, alone.relative_rms_error);
        EXPECT_EQ(shared.normalized_error, alone.normalized_error);
        EXPECT_EQ(shared.channel_error, alone.channel_error);
        EXPECT_EQ(shared.chi_square_per_dof, alone.chi_square_per_dof);
        EXPECT_EQ(shared.reason, alone.reason);
        EXPECT_EQ(shared.whitened_above_95, alone.whitened_above_95);
        EXPECT_EQ(shared.whiteness, alone.whiteness);
      });
  }
}

TEST_F(ValidationOfAStage, OfAZeroResponseThereIsNoRelativeError) {
  frf.response.setZero();
  const Validation result = validate(model, frf);
  EXPECT_TRUE(std::isnan(result.relative_rms_error));
  EXPECT_TRUE(std::isnan(result.normalized_error));
}

}  // namespace stageid::test_validation
