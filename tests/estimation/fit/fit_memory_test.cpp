// Heap memory of a fit, relative to the bytes of its data: response, variances and weights.

#include <gtest/gtest.h>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/iteration/fit_iteration.hpp"
#include "estimation/problem/fit_start.hpp"
#include "estimation/search/structured_fit.hpp"
#include "tests/support/process/heap_use.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test_fit_memory {

constexpr double kBeyond = 0.2;  // of the data

/// 3600 channels x 800 lines, 92 MB with the weights, rigid body and ten modes: blocks and tiles take some
/// 15 MB however many channels and lines there are.
class FitMemory : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::HeapPeak::works()) GTEST_SKIP() << "malloc is not ours in this build";
    test::RandomStageSpec spec;
    spec.outputs = spec.inputs = 60;
    spec.least_modes = spec.most_modes = 10;
    spec.line_spacing_hz = 2.475;
    test::RandomStage stage = test::draw_random_stage(7, spec);
    frf_ = std::move(stage.frf);
    start_ = std::move(stage.truth);
    options_.weighting = Weighting::noise_variance;
    options_.hold = HoldModel::exact;
    options_.delay_s = stage.delay_s;
    options_.threads = 2;
    options_.response_variance = false;
    entry_ = static_cast<double>(frf_.response.size() * static_cast<Eigen::Index>(sizeof(double)));
  }

  /// Bytes of the data that exist before the fit.
  double given() const {
    const auto real = frf_.noise_variance.size() + frf_.total_variance.size() +
                      2 * frf_.residual_covariance.size();
    return static_cast<double>(real) * sizeof(double) + 2.0 * entry_;
  }

  /// @param made matrices of the data's size that the fit has to make: weights, variance of the response
  template <typename Fit>
  void expect_little_beside(double made, const Fit& fit) {
    const test::HeapPeak peak;
    const FitResult result = fit();
    const double taken = static_cast<double>(peak.bytes());
    ASSERT_TRUE(result.trustworthy()) << result.message();
    ASSERT_TRUE(result.model.submodels[1].natural_frequency_std_hz);
    EXPECT_LT(taken, made * entry_ + kBeyond * (given() + made * entry_))
        << (given() + taken) / (given() + made * entry_) << " times the data";
    EXPECT_GT(taken, made * entry_);  // the weights at least: the count is right
  }

  FrfEstimate frf_;
  AdditiveModel start_;
  FitOptions options_;
  double entry_ = 0.0;  // bytes of a real matrix of the data's size
};

TEST_F(FitMemory, IsTheDataAndTheirWeights) {
  expect_little_beside(1.0, [&] { return fit_additive_model(frf_, start_, options_); });
}

TEST_F(FitMemory, HasTheVarianceOfTheResponseOnceWhereItIsAskedFor) {
  options_.response_variance = true;
  expect_little_beside(2.0, [&] {
    FitResult result = fit_additive_model(frf_, start_, options_);
    EXPECT_EQ(result.response_variance.size(), frf_.response.size());
    return result;
  });
}

TEST_F(FitMemory, DoesNotGrowWhereTheVarianceIsNotTheWeights) {
  frf_.total_variance = 1.5 * frf_.noise_variance;
  options_.weighting = Weighting::relative;
  expect_little_beside(1.0, [&] { return fit_additive_model(frf_, start_, options_); });
}

TEST_F(FitMemory, DoesNotGrowWithASearchForTheDelay) {
  options_.delay = DelayModel::estimate;
  options_.delay_s = 0.0;
  start_.input_delay_s.resize(0);
  expect_little_beside(1.0, [&] { return fit_additive_model(frf_, start_, options_); });
}

TEST_F(FitMemory, DoesNotGrowWhereFewDegreesOfFreedomAreSmoothed) {
  frf_.noise_dof = 6.0;
  expect_little_beside(1.0, [&] { return fit_additive_model(frf_, start_, options_); });
}

TEST_F(FitMemory, DoesNotGrowWithTheCorrelationOfTheOutputs) {
  const Eigen::Index n_y = frf_.n_outputs();
  frf_.residual_covariance.setConstant(n_y * n_y, frf_.lines(), 0.3);
  for (Eigen::Index y = 0; y < n_y; ++y) frf_.residual_covariance.row(y * (n_y + 1)).setOnes();
  expect_little_beside(1.0, [&] { return fit_additive_model(frf_, start_, options_); });
}

TEST_F(FitMemory, HoldsForTheWholeWayFromGivenModes) {
  RequestedStructure structure;
  ModeSelection selection;
  for (const Submodel& s : start_.submodels)
    if (s.is_mode()) selection.modes.push_back({s.natural_frequency_hz(), s.damping_ratio(), 1});
  selection.keep_modes = true;
  expect_little_beside(1.0, [&] { return structured_fit(frf_, structure, selection, options_); });
}

TEST_F(FitMemory, HoldsForTheWholeWayFromNothingWithTheDelayEstimated) {
  options_.delay = DelayModel::estimate;
  options_.delay_s = 0.0;
  expect_little_beside(1.0, [&] { return structured_fit(frf_, {}, {}, options_); });
}

TEST_F(FitMemory, DoesNotGrowWithADelayPerChannel) {
  options_.delay = DelayModel::per_channel;
  options_.max_iterations = 1;
  start_.input_delay_s.array() += Eigen::ArrayXd::LinSpaced(frf_.n_inputs(), 0.0, 1e-6);
  start_.output_delay_s = Eigen::VectorXd::LinSpaced(frf_.n_outputs(), 1e-8, 0.0);
  const FitProblem problem = make_problem(frf_, start_, options_, make_weights(frf_, options_));
  FitParameters beta = make_parameters(problem, start_, options_);
  const test::HeapPeak peak;
  iterate(problem, beta, options_);
  EXPECT_LT(static_cast<double>(peak.bytes()), kBeyond * (given() + entry_));
}

}  // namespace stageid::test_fit_memory
