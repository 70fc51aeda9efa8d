// Requests that a fit rejects, and their messages.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/search/structured_fit.hpp"
#include "tests/estimation/noisy_stage.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_fit_refusal {

using test::DenseProblem;
using test::moved;
using test::noisy_stage;
using testing::HasSubstr;

struct Request {
  DenseProblem problem = noisy_stage(HoldModel::exact, 0.01);
  FrfEstimate frf = test::frf_of(problem);
  AdditiveModel start = moved(problem.model, 1.0, 1.0);
  FitOptions options;
};

struct Refusal {
  void (*spoil)(Request&);
  const char* message;
};

const Eigen::MatrixXd kZero = Eigen::MatrixXd::Zero(2, 3);

const Refusal kRefusals[] = {
    {[](Request& r) { r.start.submodels.clear(); }, "no submodel"},
    {[](Request& r) { r.frf.response *= 1e-170; }, "out of range for double precision"},
    {[](Request& r) { r.frf.response *= 1e170; }, "out of range for double precision"},
    {[](Request& r) { r.options.max_iterations = -1; }, "max_iterations"},
    {[](Request& r) { r.options.delay_s = std::nan(""); }, "delay must be finite"},
    {[](Request& r) {
       r.frf.hold = Hold::none;
       r.frf.sample_rate_hz = 3600.0;
       r.options.hold = HoldModel::exact;
     },
     "half the sample rate"},
    {[](Request& r) { r.start.submodels[1].denominator[0] = 2.0; }, "must start with 1"},
    {[](Request& r) { r.start.submodels[1].denominator.clear(); }, "must start with 1"},
    {[](Request& r) { r.start.submodels[1].denominator.back() = 0.0; }, "not end with 0"},
    {[](Request& r) { r.start.submodels[1].denominator.back() = std::nan(""); }, "must be finite"},
    {[](Request& r) { r.start.submodels[0].integrators = 3; }, "0, 1 or 2 integrators"},
    {[](Request& r) { r.start.submodels[0].integrators = -1; }, "0, 1 or 2 integrators"},
    {[](Request& r) { r.start.submodels[1].numerator.clear(); }, "proper and have a numerator"},
    {[](Request& r) { r.start.submodels[1].numerator.assign(4, kZero); },
     "proper and have a numerator"},
    {[](Request& r) { r.start.submodels[1].numerator[0].resize(3, 2); }, "outputs x inputs"},
    {[](Request& r) {
       for (const int i : {1, 2}) r.start.submodels[i].numerator.assign(3, kZero);
     },
     "biproper"},
    {[](Request& r) { r.start.submodels[1].integrators = 1; }, "may have integrators"},
    {[](Request& r) { r.frf = select_band(r.frf, 20.0, 21.0); }, "too few for"},
    {[](Request& r) { r.frf.response(3, 7) = std::nan(""); }, "response[line 7"},
};

std::string refusal(const Request& r) {
  return test::error_message<std::invalid_argument>(
      [&] { fit_additive_model(r.frf, r.start, r.options); });
}

TEST(FitRefusal, NamesWhatIsWrong) {
  const Request right;
  for (const auto& [spoil, message] : kRefusals) {
    Request wrong = right;
    spoil(wrong);
    EXPECT_THAT(refusal(wrong), HasSubstr(message));
  }
}

TEST(FitRefusal, AHoldWithoutSampleRate) {
  Request request;
  request.frf.sample_rate_hz = 0.0;
  for (const HoldModel hold : {HoldModel::phase, HoldModel::sinc, HoldModel::exact}) {
    request.options.hold = hold;
    EXPECT_THAT(refusal(request), HasSubstr("needs a sample rate"));
  }
}

TEST(FitRefusal, AResponseOfZerosHasNoModel) {
  FrfEstimate frf = Request().frf;
  frf.response.setZero();
  for (const int modes : {0, 2})
    EXPECT_THAT(test::error_message<std::invalid_argument>(
                    [&] { structured_fit(frf, {}, {.modes = {}, .exactly = modes}, {}); }),
                HasSubstr("is zero"));
}

}  // namespace stageid::test_fit_refusal
