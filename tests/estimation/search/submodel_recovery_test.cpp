// The general additive structure: recovery of submodels that are not modes. The data are computed by the matrix
// exponential of tests/support, not by the library.

#include <gtest/gtest.h>

#include <cmath>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/estimation/submodel_cases.hpp"

namespace stageid::test_submodel_recovery {

using test::DenseProblem;
using test::joined;
using test::measured;
using test::Part;
using test::Poles;
using test::real_pole;
using test::start_of;

void expect_recovered(const AdditiveModel& found, const AdditiveModel& truth) {
  ASSERT_EQ(found.submodels.size(), truth.submodels.size());
  for (std::size_t i = 0; i < truth.submodels.size(); ++i) {
    const Submodel& f = found.submodels[i];
    const Submodel& t = truth.submodels[i];
    for (std::size_t q = 1; q < t.denominator.size(); ++q)
      EXPECT_NEAR(f.denominator[q], t.denominator[q], 1e-6 * std::abs(t.denominator[q]))
          << "submodel " << i << ", a_" << q;
    for (std::size_t m = 0; m < t.numerator.size(); ++m)
      EXPECT_LT((f.numerator[m] - t.numerator[m]).norm(), 1e-5 * t.numerator[m].norm())
          << "submodel " << i << ", B_" << m;
  }
}

struct Case {
  const char* name;
  std::vector<Part> parts;
};

std::vector<Case> cases() {
  const Poles mode = mode_poles(130.0, 0.02);
  const Poles other = mode_poles(410.0, 0.01);
  const Poles third = mode_poles(640.0, 0.015);
  return {
      {"ModeWithVelocity", {{0, mode, 1}}},
      {"RealPole", {{0, {real_pole(60.0)}, 0}, {0, mode, 0}}},
      {"FourthOrder", {{0, joined(mode, other), 3}, {0, third, 0}}},
      {"FourthOrderConstantNumerator", {{0, joined(mode, other), 0}}},
      {"ThirdOrder", {{0, joined(mode, {real_pole(90.0)}), 2}}},
      {"OneIntegrator", {{1, {}, 0}, {0, mode, 1}}},
      {"IntegratorsAndPoles", {{2, mode, 1}, {0, other, 1}}},
      {"DirectTerm", {{0, {}, 0}, {0, mode, 0}}},
      {"Biproper", {{0, joined(mode, third), 4}, {2, {}, 0}, {0, other, 1}}},
  };
}

class SubmodelRecovery : public testing::TestWithParam<Case> {
 protected:
  void expect_found(FitOptions options, double delay_s = 0.0) const {
    SCOPED_TRACE(std::string(to_string(options.hold)) + ", " + to_string(options.method));
    const std::vector<Part>& parts = GetParam().parts;
    const DenseProblem problem = measured(parts, options.hold, delay_s);
    options.max_iterations = 200;
    const FitResult fit =
        fit_additive_model(test::frf_of(problem), start_of(parts, problem), options);
    EXPECT_TRUE(fit.trustworthy()) << fit.message();
    expect_recovered(fit.model, problem.model);
    EXPECT_NEAR(fit.model.input_delay_s[0], delay_s, 1e-10);
  }
};

TEST_P(SubmodelRecovery, ByEveryDescentMethodThroughHoldAndDelay) {
  for (const FitMethod method : {FitMethod::riv, FitMethod::gn}) {
    FitOptions options;
    options.method = method;
    expect_found(options);
    options.hold = HoldModel::exact;
    options.delay = DelayModel::estimate;
    expect_found(options, 3.1e-4);
  }
}

// Without noise, its fixed point is the true model.
TEST_P(SubmodelRecovery, BySanathananAndKoerner) {
  FitOptions options;
  options.method = FitMethod::sk;
  expect_found(options);
}

TEST_P(SubmodelRecovery, UnderWeightMatrices) {
  FitOptions options = test::fit_options(Weighting::user);
  // Hermitian, positive definite, with ties between all channels.
  Eigen::MatrixXcd root = Eigen::MatrixXcd::Identity(4, 4);
  root(0, 1) = {0.3, 0.2};
  root(2, 3) = {0.1, -0.4};
  const Eigen::MatrixXcd W = root * root.adjoint();
  options.user_weight_matrices = W.reshaped().replicate(1, 400);
  expect_found(options);
}

INSTANTIATE_TEST_SUITE_P(Of, SubmodelRecovery, testing::ValuesIn(cases()),
                         [](const auto& each) { return each.param.name; });

}  // namespace stageid::test_submodel_recovery
