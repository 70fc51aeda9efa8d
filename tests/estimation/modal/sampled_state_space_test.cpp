#include "estimation/modal/sampled_state_space.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>

#include "tests/estimation/basis_cases.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/random_stage.hpp"
#include "tests/support/stages/state_space_response.hpp"

namespace stageid::test_sampled_state_space {

using Complex = std::complex<double>;
using test::basis::kPeriod;

/// A rigid body, a lag, a mode and optionally a direct term, at the sample rate of the cases.
AdditiveModel delayed_model(const Eigen::VectorXd& input_samples,
                            const Eigen::VectorXd& output_samples, bool direct = true) {
  test::RandomNumbers random(5);
  AdditiveModel model = test::named_model(static_cast<int>(output_samples.size()),
                                          static_cast<int>(input_samples.size()));
  model.sample_rate_hz = 1.0 / kPeriod;
  model.hold = HoldModel::exact;
  model.input_delay_s = input_samples * kPeriod;
  model.output_delay_s = output_samples * kPeriod;
  model.submodels = {test::empty_submodel(model, 2, {}, 1),
                     test::empty_submodel(model, 0, {1e-3}, 1),
                     test::empty_mode(model, 700.0, 0.01, 2)};
  if (direct) model.submodels.push_back(test::empty_submodel(model, 0, {}, 1));
  for (Submodel& s : model.submodels)
    for (std::size_t m = 0; m < s.numerator.size(); ++m)
      for (double& value : s.numerator[m].reshaped())
        value = random.normal() * (s.integrators == 2 ? 1e6 : 1.0) * (m == 1 ? 1e-3 : 1.0);
  return model;
}

double deviation(const AdditiveModel& model) {
  const Eigen::VectorXd lines = test::basis::lines_hz();
  return test::largest_deviation(test::response_of(sampled_state_space(model), lines),
                                 response(model, lines, HoldModel::exact));
}

TEST(SampledStateSpace, EverySubmodelTheFileAllowsIsSampledExactly) {
  const Eigen::VectorXd lines = test::basis::lines_hz();
  for (const test::basis::Case& c : test::basis::cases())
    for (int degree = 0; degree <= c.integrators + c.shape().order; ++degree) {
      SCOPED_TRACE(c.name + ", degree " + std::to_string(degree));
      AdditiveModel model = delayed_model(Eigen::VectorXd{{1.3, 0.4}}, Eigen::VectorXd{{0.0}});
      Submodel s = test::empty_submodel(model, c.integrators, c.a(), degree + 1);
      s.numerator.back() << 1.0, -2.0;
      model.submodels = {s};
      const Eigen::MatrixXcd expected = test::reference_response(model, lines, HoldModel::exact);
      const Eigen::MatrixXcd found = test::response_of(sampled_state_space(model), lines);
      for (Eigen::Index k = 0; k < lines.size(); ++k) {
        // Biproper functions do not decay as in amplification(), because they are not partial fractions.
        const double growth = std::max(
            1.0, test::basis::amplification(c, degree, 1, 2.0 * std::numbers::pi * lines[k]));
        EXPECT_LT((found - expected).col(k).norm(), 1e-13 * growth * expected.col(k).norm())
            << lines[k] << " Hz";
      }
    }
}

TEST(SampledStateSpace, AgreesWithScipy) {
  std::ifstream file(std::filesystem::path(STAGEID_SOURCE_DIR) /
                     "tests/estimation/reference/sampled_state_space.json");
  const nlohmann::json reference = nlohmann::json::parse(file);
  const test::TemporaryDirectory directory;
  std::ofstream(directory / "model.json") << reference["model"].dump();
  const AdditiveModel model = read_model(directory / "model.json");
  const auto hz = reference["frequency_hz"].get<std::vector<double>>();
  const Eigen::VectorXd lines = Eigen::Map<const Eigen::VectorXd>(hz.data(), std::ssize(hz));
  Eigen::MatrixXcd expected(6, lines.size());
  for (Eigen::Index k = 0; k < lines.size(); ++k)
    for (Eigen::Index c = 0; c < 6; ++c) {
      const auto& value = reference["response"][k][c % 2][static_cast<std::size_t>(c / 2)];
      expected(c, k) = {value[0].get<double>(), value[1].get<double>()};
    }
  const SampledStateSpace sampled = sampled_state_space(model);
  // Rounding of scipy's matrix exponential over ten steps, times the double integrator at 1 Hz.
  EXPECT_LT(test::largest_deviation(test::response_of(sampled, lines), expected), 1e-10);
}

TEST(SampledStateSpace, StageOfThePaperHasFortyStatesBehindItsDelay) {
  test::RandomStageSpec spec;
  spec.least_modes = spec.most_modes = 17;
  const test::RandomStage stage = test::draw_random_stage(3, spec);
  const SampledStateSpace sampled = sampled_state_space(stage.truth);
  EXPECT_EQ(sampled.system.order(), 40);
  const Eigen::VectorXd lines = Eigen::VectorXd::LinSpaced(500, 1.0, 4999.0);
  // Of the double integrator at 1 Hz, 1 - z^-1 cancels 3 digits twice in both.
  EXPECT_LT(test::largest_deviation(test::response_of(sampled, lines),
                                    response(stage.truth, lines, HoldModel::exact)),
            1e-10);
  const Eigen::VectorXd upper = lines.tail(490);
  EXPECT_LT(test::largest_deviation(test::response_of(sampled, upper),
                                    response(stage.truth, upper, HoldModel::exact)),
            1e-12);
}

TEST(SampledStateSpace, DelaysOfOneSideNeedNoStates) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(2);
  const Eigen::VectorXd spread{{0.0, 0.3, 2.9, 7.0}};
  struct Delays {
    Eigen::VectorXd input;
    Eigen::VectorXd output;
  };
  const Eigen::VectorXd same = Eigen::VectorXd::Constant(4, 1.9);
  for (const Delays& delays :
       {Delays{Eigen::VectorXd::Zero(4), zero}, Delays{same, zero}, Delays{spread, zero},
        Delays{spread, Eigen::VectorXd{{0.7, 0.7}}}, Delays{same, Eigen::VectorXd{{0.0, 0.2}}},
        Delays{same, Eigen::VectorXd{{0.4, 5.3}}},
        Delays{Eigen::VectorXd{{0.1, 1.2, 0.3, 4.1}}, Eigen::VectorXd{{0.2, 3.5}}}}) {
    SCOPED_TRACE(testing::Message()
                 << delays.input.transpose() << "; " << delays.output.transpose());
    const AdditiveModel model = delayed_model(delays.input, delays.output);
    const SampledStateSpace sampled = sampled_state_space(model);
    EXPECT_EQ(sampled.system.order(), state_space(model).order());
    EXPECT_GE(sampled.input_delay_samples.minCoeff(), 0);
    EXPECT_EQ(sampled.output_delay_samples.minCoeff(), 0);
    EXPECT_LT(deviation(model), 1e-11);
  }
}

TEST(SampledStateSpace, DelaysThatDoNotAddUpHaveDelayStates) {
  // Sums 0.2, 0.7; 0.9, 1.4 of a sample: the last channel alone is a sample later.
  const AdditiveModel model =
      delayed_model(Eigen::VectorXd{{0.2, 0.9}}, Eigen::VectorXd{{0.0, 0.5}});
  const SampledStateSpace sampled = sampled_state_space(model);
  EXPECT_EQ(sampled.system.order(), state_space(model).order() + 1);
  EXPECT_EQ(sampled.system.blocks.back().submodel, -1);
  EXPECT_EQ(sampled.system.blocks.back().pole, 0.0);
  EXPECT_LT(deviation(model), 1e-11);
}

TEST(SampledStateSpace, IsMinimalWithItsDelayStates) {
  const AdditiveModel model =
      delayed_model(Eigen::VectorXd{{0.2, 0.9}}, Eigen::VectorXd{{0.0, 0.5}});
  StateSpace system = sampled_state_space(model).system;
  // Rows of norm one: the rigid body is 1e6 times a mode. Measured 3e-9 and 2e-9, for eleven states
  // whose poles lie close to 1.
  const auto rows_of_one = [](const Eigen::MatrixXd& B) { return B.rowwise().normalized().eval(); };
  EXPECT_GT(test::controllability(system.A, rows_of_one(system.B)), 1e-10);
  EXPECT_GT(test::controllability(system.A.transpose(), rows_of_one(system.C.transpose())), 1e-10);
  // The measure would notice: a delay state that repeats a lag of the same input.
  system.A.row(4).setZero();
  system.A.col(4).setZero();
  system.B.row(4) = system.B.bottomRows(1);
  EXPECT_LT(test::controllability(system.A, rows_of_one(system.B)), 1e-14);
}

TEST(SampledStateSpace, NegativeDelaysAreKept) {
  const AdditiveModel little = delayed_model(Eigen::VectorXd{{-0.01, 0.0}}, Eigen::VectorXd{{0.0}});
  EXPECT_GE(sampled_state_space(little).input_delay_samples.minCoeff(), 0);
  EXPECT_LT(deviation(little), 1e-11);
  const AdditiveModel large = delayed_model(Eigen::VectorXd{{-2.3, 0.0}}, Eigen::VectorXd{{0.0}});
  EXPECT_EQ(sampled_state_space(large).input_delay_samples[0], -2);
  EXPECT_LT(deviation(large), 1e-11);
}

TEST(SampledStateSpace, TheLastBitOfADelayAddsNoSample) {
  // 0.1 + 0.2 = 0.3000000000000000444 s: four bits too late for three samples.
  AdditiveModel model = delayed_model(Eigen::VectorXd{{0.0, 0.0}}, Eigen::VectorXd{{0.0}});
  model.sample_rate_hz = 10.0;
  model.submodels = {model.submodels.back()};
  model.input_delay_s << 0.1, 0.3;
  model.output_delay_s << 0.2;
  const SampledStateSpace sampled = sampled_state_space(model);
  EXPECT_EQ(sampled.input_delay_samples[0], 3);
  EXPECT_EQ(sampled.input_delay_samples[1], 5);
  EXPECT_EQ(sampled.system.order(), 0);
  const Eigen::VectorXd line{{1.0}};
  EXPECT_LT(test::largest_deviation(test::response_of(sampled, line),
                                    response(model, line, HoldModel::exact)),
            1e-12);
}

TEST(SampledStateSpace, RunsAsWritten) {
  // The recursion of the documentation on random numbers, against the convolution with the response
  // to one sample, which for a first-order lag is known: behind a hold and 1.25 samples of delay.
  AdditiveModel model = delayed_model(Eigen::VectorXd{{1.25}}, Eigen::VectorXd{{0.0}}, false);
  const double rate = 300.0;  // 1/s
  model.submodels = {test::empty_submodel(model, 0, {1.0 / rate}, 1)};
  model.submodels[0].numerator[0] << 2.0;
  const SampledStateSpace sampled = sampled_state_space(model);
  const auto step = [&](double t) { return t > 0.0 ? 2.0 * (1.0 - std::exp(-rate * t)) : 0.0; };

  constexpr int kSamples = 60;
  test::RandomNumbers random(1);
  const Eigen::VectorXd u = test::random_vector(random, kSamples);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(sampled.system.order());
  for (int n = 0; n < kSamples; ++n) {
    const long long at = n - sampled.input_delay_samples[0];
    const Eigen::VectorXd input = Eigen::VectorXd::Constant(1, at >= 0 ? u[at] : 0.0);
    const double y = (sampled.system.C * x + sampled.system.D * input).value();
    x = sampled.system.A * x + sampled.system.B * input;
    double expected = 0.0;
    for (int k = 0; k <= n; ++k) {
      const double since = (n - k - 1.25) * kPeriod;
      expected += u[k] * (step(since) - step(since - kPeriod));
    }
    EXPECT_NEAR(y, expected, 1e-13) << "sample " << n;
  }
}

TEST(SampledStateSpace, NeedsASampleRateAndAModelThatHasAStateSpace) {
  AdditiveModel model = delayed_model(Eigen::VectorXd{{0.0}}, Eigen::VectorXd{{0.0}});
  model.submodels.push_back(test::empty_submodel(model, 0, {2.0, 1.0}, 1));
  EXPECT_THROW(sampled_state_space(model), std::invalid_argument);
  model.submodels.pop_back();
  model.sample_rate_hz = 0.0;
  EXPECT_THROW(sampled_state_space(model), std::invalid_argument);
}

}  // namespace stageid::test_sampled_state_space
