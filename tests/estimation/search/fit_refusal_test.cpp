// Requests that a fit rejects, and their messages.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "estimation/search/fit_additive_model.hpp"
#include "estimation/search/structured_fit.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test_fit_refusal {

using test::DenseProblem;
using test::moved;
using test::noisy_stage;

class FitRefusal : public testing::Test {
 protected:
  void expect_refused(const std::string& part) {
    EXPECT_THAT([this] { (void)fit_additive_model(frf_, start_, options_); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr(part)));
  }
  DenseProblem problem_ = noisy_stage(HoldModel::exact, 0.01);
  FrfEstimate frf_ = test::frf_of(problem_);
  AdditiveModel start_ = moved(problem_.model, 1.0, 1.0);
  FitOptions options_;
};

TEST_F(FitRefusal, NothingIsWrongWithTheFixture) {
  options_.max_iterations = 0;
  EXPECT_NO_THROW((void)fit_additive_model(frf_, start_, options_));
}

TEST_F(FitRefusal, NoSubmodel) {
  start_.submodels.clear();
  expect_refused("no submodel");
}
TEST_F(FitRefusal, AResponseOfZerosHasNoModel) {
  frf_.response.setZero();
  for (const int modes : {0, 2})
    EXPECT_THAT([&] { (void)structured_fit(frf_, {}, {.modes = {}, .exactly = modes}, options_); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("is zero")));
}
TEST_F(FitRefusal, AResponseWhoseWeightsLeaveTheRangeOfNumbers) {
  options_.weighting = Weighting::relative;
  const Eigen::MatrixXcd response = frf_.response;
  for (const double scale : {1e-170, 1e170}) {
    frf_.response = scale * response;
    expect_refused("out of range for double precision");
  }
}
TEST_F(FitRefusal, NegativeIterations) {
  options_.max_iterations = -1;
  expect_refused("max_iterations");
}
TEST_F(FitRefusal, ADelayThatIsNotANumber) {
  options_.delay_s = std::nan("");
  expect_refused("delay must be finite");
}
TEST_F(FitRefusal, AHoldWithoutSampleRate) {
  frf_.sample_rate_hz = 0.0;
  for (const HoldModel hold : {HoldModel::phase, HoldModel::sinc, HoldModel::exact}) {
    options_.hold = hold;
    expect_refused("needs a sample rate");
  }
}
TEST_F(FitRefusal, LinesAtHalfTheSampleRate) {
  frf_.hold = Hold::none;
  frf_.sample_rate_hz = 3600.0;
  options_.hold = HoldModel::exact;
  expect_refused("half the sample rate");
}
TEST_F(FitRefusal, ADenominatorThatDoesNotStartWithOne) {
  start_.submodels[1].denominator[0] = 2.0;
  expect_refused("must start with 1");
  start_.submodels[1].denominator.clear();
  expect_refused("must start with 1");
}
TEST_F(FitRefusal, ADenominatorThatEndsWithZeroOrIsNotFinite) {
  start_.submodels[1].denominator.back() = 0.0;
  expect_refused("not end with 0");
  start_.submodels[1].denominator.back() = std::nan("");
  expect_refused("must be finite");
}
TEST_F(FitRefusal, ThreeIntegrators) {
  start_.submodels[0].integrators = 3;
  expect_refused("0, 1 or 2 integrators");
  start_.submodels[0].integrators = -1;
  expect_refused("0, 1 or 2 integrators");
}
TEST_F(FitRefusal, ImproperOrWithoutNumerator) {
  start_.submodels[1].numerator.clear();
  expect_refused("proper and have a numerator");
  start_.submodels[1].numerator.assign(4, Eigen::MatrixXd::Zero(2, 3));
  expect_refused("proper and have a numerator");
}
TEST_F(FitRefusal, ANumeratorOfAnotherShape) {
  start_.submodels[1].numerator[0] = Eigen::MatrixXd::Zero(3, 2);
  expect_refused("outputs x inputs");
}
TEST_F(FitRefusal, TwoBiproperSubmodels) {
  start_.submodels[1].numerator.assign(3, Eigen::MatrixXd::Zero(2, 3));
  start_.submodels[2].numerator.assign(3, Eigen::MatrixXd::Zero(2, 3));
  expect_refused("biproper");
}
TEST_F(FitRefusal, TwoSubmodelsWithIntegrators) {
  start_.submodels[1].integrators = 1;
  expect_refused("may have integrators");
}
TEST_F(FitRefusal, MoreParametersThanData) {
  frf_ = select_band(frf_, 20.0, 21.0);
  expect_refused("too few for");
}
TEST_F(FitRefusal, AnFrfThatIsNotOne) {
  frf_.response(3, 7) = std::complex<double>(std::nan(""), 0.0);
  expect_refused("response[line 7");
}
TEST_F(FitRefusal, WeightsThatAreNotThere) {
  options_.weighting = Weighting::noise_variance;
  expect_refused("noise_variance");
}

}  // namespace stageid::test_fit_refusal
