// A fit with default settings must find the modes.

#include "estimation/search/automatic_fit.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "estimation/request/fit_request.hpp"
#include "tests/support/models/expect_same_fit.hpp"
#include "tests/support/models/model_blind_fit.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_automatic_fit {

using testing::Contains;
using testing::DoubleNear;
using testing::HasSubstr;
using testing::StartsWith;

/// The paper's stage on every third of its lines: quick, and the sharpest modes (0.2 % at 100 Hz)
/// have hardly a line in their half-power width.
test::RandomStageSpec quick_stage() {
  test::RandomStageSpec spec;
  spec.line_spacing_hz = 1.5;
  return spec;
}

// The share is a promise, and below it something has become worse: 500 of 500 stages on the paper's
// full grid succeed in tests/benchmark/blind_fit_study (docs/benchmarks.md).
TEST(AutomaticFit, FindsWhatIsThereBlind) {
  constexpr int kStages = 10;
  constexpr int kDemanded = 9;
  int successes = 0;
  std::string failures;
  for (std::uint64_t seed = 101; seed < 101 + kStages; ++seed) {
    const test::RandomStage stage = test::draw_random_stage(seed, quick_stage());
    const test::BlindFit fit = test::fit_blind(stage, 0);
    if (fit.success)
      ++successes;
    else
      failures += fmt::format("seed {}: {}\n{}\n", seed, stage.description(), fit.report());
  }
  RecordProperty("successes", successes);
  EXPECT_GE(successes, kDemanded) << failures;
  if (!failures.empty()) std::fputs(failures.c_str(), stdout);
}

// The measure itself must be able to fail: a fit with two modes too few is not a success.
TEST(AutomaticFit, TheMeasureOfSuccessSeesAMissingMode) {
  const test::RandomStage stage = test::draw_random_stage(101, quick_stage());
  FitOptions options = test::fit_options(Weighting::noise_variance, HoldModel::exact,
                                         DelayModel::fixed, stage.delay_s);
  options.uncertainty = false;
  AdditiveModel less = stage.truth;
  less.submodels.pop_back();
  const double all = fit_additive_model(stage.frf, stage.truth, options).model.fit.cost;
  EXPECT_GT(fit_additive_model(stage.frf, less, options).model.fit.cost, 1.005 * all);
}

/// A 2 x 2 stage with three well separated modes and 0.5 % relative noise; no sample rate.
class SmallStage : public testing::Test {
 protected:
  void SetUp() override {
    test::RandomNumbers random(55);
    problem_.model = test::named_model(2, 2);
    problem_.frequency_hz = Eigen::VectorXd::LinSpaced(500, 10.0, 1000.0);
    problem_.model.submodels.push_back(test::empty_submodel(problem_.model, 2, {}, 1));
    for (const double f : {120.0, 390.0, 640.0})
      problem_.model.submodels.push_back(test::empty_mode(problem_.model, f, 0.01));
    for (Submodel& s : problem_.model.submodels)
      for (double& value : s.numerator[0].reshaped())
        value = (s.is_mode() ? s.denominator[2] : 1.0) * (random.uniform() < 0.5 ? -1.0 : 1.0) *
                random.uniform(0.5, 2.0);
    test::measure(problem_);
    frf_ = test::frf_of(problem_);
    test::add_relative_noise(frf_.response, 0.005, random);
  }

  static std::vector<double> frequencies(const AdditiveModel& model) {
    std::vector<double> out;
    for (const Submodel& s : model.submodels)
      if (s.is_mode()) out.push_back(s.natural_frequency_hz());
    return out;
  }

  test::DenseProblem problem_;
  FrfEstimate frf_;
};

testing::Matcher<std::vector<double>> near_hz(std::initializer_list<double> expected) {
  std::vector<testing::Matcher<double>> each;
  for (const double f : expected) each.push_back(DoubleNear(f, 1e-4 * f));
  return testing::ElementsAreArray(each);
}

TEST_F(SmallStage, FindsItsModesAndSaysWhatItDid) {
  const FitResult fit = automatic_fit(frf_, {}, {}, {});
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_THAT(frequencies(fit.model), near_hz({120.0, 390.0, 640.0}));
  EXPECT_EQ(fit.model.submodels.size(), 4U);
  EXPECT_EQ(fit.model.submodels[0].integrators, 2);
  ASSERT_FALSE(fit.decisions.empty());
  EXPECT_THAT(fit.decisions.front(), HasSubstr("peaks of the CMIF"));
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("no further mode")));
}

TEST_F(SmallStage, CompletesAStartThatLacksAMode) {
  const FitResult fit =
      automatic_fit(frf_, {}, {.modes = {{121.0, 0.01, 1}, {638.0, 0.01, 1}}}, {});
  EXPECT_THAT(frequencies(fit.model), near_hz({120.0, 390.0, 640.0}));
  EXPECT_THAT(fit.decisions, Contains(StartsWith("added 39")));
}

TEST_F(SmallStage, DropsModesThatAreNotThereAndMergesTwoOnOnePeak) {
  const std::vector<ModeCandidate> modes = {
      {119.5, 0.01, 1}, {120.5, 0.01, 1}, {250.0, 0.01, 1}, {391.0, 0.01, 1}, {639.0, 0.01, 1}};
  const FitResult fit = automatic_fit(frf_, {}, {.modes = modes}, {});
  EXPECT_THAT(frequencies(fit.model), near_hz({120.0, 390.0, 640.0}));
  EXPECT_THAT(fit.decisions, Contains(StartsWith("dropped")));
}

TEST_F(SmallStage, FitsSoManyModesAsAsked) {
  for (const int count : {1, 2, 3, 4}) {
    const FitResult fit = automatic_fit(frf_, {}, {.modes = {}, .exactly = count}, {});
    EXPECT_EQ(frequencies(fit.model).size(), static_cast<std::size_t>(count));
  }
}

// Growing mode by mode ends near the best minimum for a given number; a path with more modes, of which the least
// worthy are dropped, finds it.
TEST_F(SmallStage, TriesMoreThanOneWayToTheNumberAsked) {
  const FitResult fit = automatic_fit(frf_, {}, {.modes = {}, .exactly = 2}, {});
  EXPECT_THAT(fit.decisions, Contains(StartsWith("2 modes, reached by way of ")));
  double best = HUGE_VAL;  // of every pair of the three true modes
  for (const auto& pair : {std::pair{120.0, 390.0}, {120.0, 640.0}, {390.0, 640.0}}) {
    const FitResult two = automatic_fit(
        frf_, {}, {.modes = {{pair.first, 0.01, 1}, {pair.second, 0.01, 1}}, .keep_modes = true},
        {});
    best = std::min(best, two.model.fit.cost);
  }
  EXPECT_LE(fit.model.fit.cost, best * (1.0 + 1e-9));
}

// The noise decides where it ends, so its standard deviation is small.
TEST_F(SmallStage, AGivenModeThatIsNoneIsNotDetermined) {
  const auto fit_of = [&](double more_hz) {
    std::vector<ModeCandidate> modes = {{121.0, 0.01, 1}, {391.0, 0.01, 1}, {638.0, 0.01, 1}};
    if (more_hz > 0.0) modes.push_back({more_hz, 0.01, 1});
    return automatic_fit(frf_, {}, {.modes = modes, .keep_modes = true}, {});
  };
  EXPECT_TRUE(fit_of(0.0).trustworthy());
  for (const double surplus_hz : {250.0, 500.0, 750.0}) {
    const FitResult fit = fit_of(surplus_hz);
    EXPECT_EQ(fit.status(), FitStatus::undetermined) << surplus_hz;
  }
}

// Free, it would go to a noise peak on the lines.
TEST_F(SmallStage, AGivenModeFarFromTheLinesIsHeld) {
  const double far_hz = 0.1 * frf_.frequency_hz[0];
  const FitResult fit = automatic_fit(
      frf_, {},
      {.modes = {{far_hz, 0.1, 1}, {121.0, 0.01, 1}, {391.0, 0.01, 1}, {638.0, 0.01, 1}},
       .keep_modes = true},
      {});
  EXPECT_NEAR(frequencies(fit.model).front(), far_hz, 1e-9);
}

/// The exact response of one channel with these modes, without variances.
FrfEstimate response_of(const std::vector<double>& frequency_hz, double damping_ratio,
                        const Eigen::VectorXd& lines_hz) {
  FrfEstimate frf;
  frf.frequency_hz = lines_hz;
  frf.inputs = {{"u"}, {"N"}};
  frf.outputs = {{"y"}, {"m"}};
  AdditiveModel truth;
  truth.inputs = frf.inputs;
  truth.outputs = frf.outputs;
  truth.input_delay_s = truth.output_delay_s = Eigen::VectorXd::Zero(1);
  for (const double hz : frequency_hz) {
    const std::vector<double> a = test::mode_coefficients(hz, damping_ratio);
    truth.submodels.push_back(
        {0, {1.0, a[0], a[1]}, {Eigen::MatrixXd::Constant(1, 1, a[1])}, {}, {}});
  }
  frf.response = test::reference_response(truth, frf.frequency_hz, HoldModel::none);
  return frf;
}

/// One channel with so many modes, 20 Hz apart, and a thousandth of noise.
FrfEstimate comb_of(int modes) {
  std::vector<double> frequency_hz;
  for (int r = 1; r <= modes; ++r) frequency_hz.push_back(20.0 * r);
  FrfEstimate frf = response_of(frequency_hz, 0.003, Eigen::VectorXd::LinSpaced(4000, 5.0, 1500.0));
  test::RandomNumbers random(1);
  frf.noise_variance = 1e-6 * frf.response.cwiseAbs2();
  frf.noise_dof = 1000.0;
  test::add_noise(frf, random);
  return frf;
}

// There is no largest number: a search that ended at 60 modes was called trustworthy.
TEST(AutomaticFit, FindsManyModes) {
  const FitResult fit = fit_model(comb_of(70), {});
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_EQ(fit.model.submodels.size(), 70U);
  EXPECT_LT(fit.model.fit.cost, 0.5);
}

// More than 40 requested modes were a path of their own, on which modes hidden by noise counted as determined.
TEST(AutomaticFit, ModesHiddenByNoiseAreHeldAndToldWhateverTheirNumber) {
  std::ptrdiff_t held = 0;
  for (const int modes : {3, 40}) {
    SCOPED_TRACE(modes);
    FitRequest request;
    request.modes = {ModesRequest::Kind::count, modes + 2, {}};
    const FitResult fit = fit_model(comb_of(modes), request);
    EXPECT_EQ(fit.status(), FitStatus::undetermined);
    EXPECT_THAT(fit.message(), HasSubstr("the data do not support the modes at"));
    held += std::ranges::count(fit.model.submodels, HeldPole::pole, &Submodel::held);
    int determined = 0;
    for (const Submodel& s : fit.model.submodels) {
      EXPECT_TRUE(s.held == HeldPole::none || s.verdict == ModeVerdict::weak);
      if (s.verdict != ModeVerdict::determined) continue;
      ++determined;
      const double number = s.natural_frequency_hz() / 20.0;
      EXPECT_LT(20.0 * std::abs(number - std::round(number)), 5.0 * *s.natural_frequency_std_hz);
    }
    EXPECT_EQ(determined, modes);
    EXPECT_LT(fit.model.fit.cost, 0.5);
  }
  EXPECT_GE(held, 2);
}

// Clusters of five in two decades, on equally spaced lines: those of the lowest clusters are few, and wider than modes.
TEST(AutomaticFit, AGivenNumberOfManyModesIsFoundExactly) {
  std::vector<double> frequency_hz;
  for (int cluster = 0; cluster < 9; ++cluster)
    for (int i = 0; i < 5; ++i)
      frequency_hz.push_back(std::pow(10.0, 0.22 * cluster + 0.03 * i + 0.01 * (i * cluster % 3)));
  FitRequest request;
  request.modes = {ModesRequest::Kind::count, static_cast<int>(frequency_hz.size()), {}};
  const FrfEstimate frf =
      response_of(frequency_hz, 0.005, Eigen::VectorXd::LinSpaced(3000, 0.7, 150.0));
  const FitResult fit = fit_model(frf, request);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_LT(fit.model.fit.relative_rms_error, 1e-9);
}

TEST_F(SmallStage, NoiseFreeDataGetTheirModesAndNoMore) {
  frf_.response = problem_.G;
  const FitResult fit = automatic_fit(frf_, {}, {}, {});
  EXPECT_THAT(frequencies(fit.model), near_hz({120.0, 390.0, 640.0}));
  EXPECT_LT(fit.model.fit.relative_rms_error, 1e-8);
}

TEST_F(SmallStage, GeneralDampingAndDirectTermAreFoundWhereTheyAre) {
  for (Submodel& s : problem_.model.submodels)
    if (s.is_mode()) s.numerator.push_back(3e-4 * s.numerator[0].colwise().reverse());
  Submodel direct = test::empty_submodel(problem_.model, 0, {}, 1);
  direct.numerator[0].setConstant(2e-8);
  problem_.model.submodels.push_back(direct);
  frf_.response = test::reference_response(problem_.model, problem_.frequency_hz, HoldModel::none);
  const FitResult fit = automatic_fit(
      frf_, {.rigid_body = true, .direct_term = true, .general_damping = true}, {}, {});
  EXPECT_LT(fit.model.fit.relative_rms_error, 1e-7) << fit.message();
  EXPECT_THAT(frequencies(fit.model), near_hz({120.0, 390.0, 640.0}));
}

TEST_F(SmallStage, WithoutRigidBodyThereIsNone) {
  problem_.model.submodels.erase(problem_.model.submodels.begin());
  frf_.response = test::reference_response(problem_.model, problem_.frequency_hz, HoldModel::none);
  const FitResult fit = automatic_fit(frf_, {.rigid_body = false}, {}, {});
  EXPECT_THAT(frequencies(fit.model), near_hz({120.0, 390.0, 640.0}));
  EXPECT_EQ(fit.model.submodels.size(), 3U);
}

TEST_F(SmallStage, ADelayThatIsDeniedEndsTheSearchAndIsNamed) {
  constexpr double kDelay_s = 1e-4;
  for (Eigen::Index k = 0; k < frf_.lines(); ++k)
    frf_.response.col(k) *= std::polar(1.0, -kDelay_s * frf_.omega_rad_s()[k]);
  for (const double denied_s : {0.0, -2e-4}) {
    FitOptions options;
    options.delay_s = denied_s;
    const FitResult fit = automatic_fit(frf_, {}, {}, options);
    EXPECT_FALSE(fit.trustworthy());
    EXPECT_THAT(fit.findings,
                testing::ElementsAre(testing::AllOf(
                    testing::ContainsRegex("a delay of (9\\.99|0\\.0001).* s instead of"),
                    HasSubstr("use --delay estimate"))));
    EXPECT_LE(frequencies(fit.model).size(), 6U);
    if (denied_s != 0.0) continue;  // such a fit need not converge
    EXPECT_EQ(fit.status(), FitStatus::unexplained) << fit.message();
  }
  FitOptions options;
  options.delay = DelayModel::estimate;
  const FitResult fit = automatic_fit(frf_, {}, {}, options);
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  EXPECT_TRUE(fit.findings.empty());
  EXPECT_THAT(frequencies(fit.model), near_hz({120.0, 390.0, 640.0}));
}

// A search that distrusted modes within the width of another discarded those of dense plants.
TEST(AutomaticFit, ModesCloserThanTheirWidthsAreAllFound) {
  std::vector<double> frequency_hz;
  for (int i = 0; i < 14; ++i) frequency_hz.push_back(26.0 + 0.5 * i);
  FrfEstimate frf = response_of(frequency_hz, 0.01, Eigen::VectorXd::LinSpaced(2000, 5.0, 60.0));
  test::RandomNumbers random(4);
  test::add_relative_noise(frf.response, 1e-3, random);
  const FitResult fit = automatic_fit(frf, {.rigid_body = false}, {}, {});
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
  ASSERT_EQ(fit.model.submodels.size(), frequency_hz.size());
  for (std::size_t i = 0; i < frequency_hz.size(); ++i)
    EXPECT_NEAR(fit.model.submodels[i].natural_frequency_hz(), frequency_hz[i], 0.05);
}

// An outlier is fitted by a mode that is sharper than the lines.
TEST_F(SmallStage, OutliersAreNotModes) {
  test::RandomNumbers random(4);
  for (std::complex<double>& value : frf_.response.reshaped())
    if (random.uniform() < 0.01) value *= 1.0 + 0.1 * random.circular();
  const FitResult fit = automatic_fit(frf_, {}, {}, {});
  for (const Submodel& s : fit.model.submodels)
    if (s.is_mode() && s.verdict == ModeVerdict::determined) {
      EXPECT_THAT((std::vector{120.0, 390.0, 640.0}),
                  Contains(DoubleNear(s.natural_frequency_hz(), 0.1)));
    }
  EXPECT_THAT(fit.decisions, Contains(HasSubstr("as an outlier does")));
}

TEST_F(SmallStage, TheNumberOfThreadsDoesNotChangeABit) {
  FitOptions options;
  options.threads = 1;
  const FitResult one = automatic_fit(frf_, {}, {}, options);
  options.threads = 2;
  test::expect_same(one, automatic_fit(frf_, {}, {}, options));
}

TEST_F(SmallStage, FewLinesAreNotOverfitted) {
  const FrfEstimate few = select_band(frf_, 100.0, 140.0);  // 20 lines, one mode
  const FitResult fit = automatic_fit(few, {}, {}, {});
  EXPECT_LE(frequencies(fit.model).size(), 3U);
  EXPECT_THAT(frequencies(fit.model), Contains(DoubleNear(120.0, 0.1)));
}

TEST_F(SmallStage, RefusesNumbersOfModesThatAreNoneOrMoreThanTheLinesCarry) {
  const FrfEstimate few = select_band(frf_, 100.0, 140.0);  // 21 lines
  const auto refusal = [&few](const ModeSelection& modes) {
    return test::error_message<std::invalid_argument>([&] { automatic_fit(few, {}, modes, {}); });
  };
  EXPECT_THAT(refusal({.modes = {}, .exactly = -1}), HasSubstr("number of modes must be positive"));
  for (const ModeSelection& modes :
       {ModeSelection{.modes = {}, .exactly = 60},
        ModeSelection{.modes = std::vector<ModeCandidate>(60, {120.0, 0.01, 1})}})
    EXPECT_THAT(refusal(modes), HasSubstr("too few for 60 modes; request at most"));
}

}  // namespace stageid::test_automatic_fit
