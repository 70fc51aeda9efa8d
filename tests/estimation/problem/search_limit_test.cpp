// A search that does not end by itself: it stops at its budget or at an interrupt, keeps its best model and advises a
// better request.

#include "estimation/problem/search_limit.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "estimation/search/automatic_fit.hpp"
#include "tests/estimation/noisy_stage.hpp"

namespace stageid::test_search_limit {

constexpr double kNoise = 0.002;
constexpr double kTinyBudget_s = 1e-6;  // less than one evaluation

using Change = std::function<void(test::DenseProblem&)>;

/// A 2 x 3 stage, three modes apart and relative noise, after `change`; variances are known.
FrfEstimate measured(std::uint64_t seed, const Change& change) {
  test::RandomNumbers random(seed);
  test::DenseProblem problem =
      test::stage_2x3(HoldModel::none, random, {{120.0, 0.01}, {390.0, 0.012}, {640.0, 0.008}});
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(400, 20.0, 1000.0);
  change(problem);
  test::measure(problem);
  FrfEstimate frf = test::frf_of(problem);
  frf.noise_variance = kNoise * kNoise * problem.G.cwiseAbs2();
  test::add_relative_noise(frf.response, kNoise, random);
  return frf;
}

FitOptions weighed() {
  FitOptions options = test::fit_options(Weighting::noise_variance);
  return options;
}

ModeSelection with_budget(double seconds) { return {.modes = {}, .search_seconds = seconds}; }

void expect_whole(const FitResult& fit) {
  EXPECT_FALSE(fit.trustworthy());
  EXPECT_LT(fit.model.fit.relative_rms_error, 1.0);
  EXPECT_GE(count_modes(fit.model), 1);
  EXPECT_FALSE(fit.decisions.empty());
  for (const Submodel& s : fit.model.submodels)
    EXPECT_EQ(s.numerator_std.size(), s.numerator.size());
}

struct BudgetCase {
  std::string name;
  Change change;
  std::string advice;
};

class SearchBudget : public testing::TestWithParam<BudgetCase> {};

TEST_P(SearchBudget, NamesTheStructureThatFitsWhatWasSeen) {
  int named = 0;
  for (const std::uint64_t seed : {3, 4, 5}) {
    const FitResult fit =
        automatic_fit(measured(seed, GetParam().change), {}, with_budget(kTinyBudget_s), weighed());
    EXPECT_EQ(fit.status(), FitStatus::search_budget);
    expect_whole(fit);
    if (fit.message().find(GetParam().advice) != std::string::npos) ++named;
    EXPECT_THAT(fit.findings, testing::Contains(testing::HasSubstr("--search-seconds")));
  }
  EXPECT_GE(named, 2) << "a search that is cut short may have come too far to see it";
}

void add_general_damping(test::DenseProblem& problem) {
  for (Submodel& s : problem.model.submodels)
    if (s.is_mode())
      s.numerator.push_back(Eigen::MatrixXd(s.numerator[0].rowwise().reverse()) /
                            (2.0 * 3.14 * s.natural_frequency_hz()));
}

void add_direct_term(test::DenseProblem& problem) {
  Submodel direct = test::empty_submodel(problem.model, 0, {}, 1);
  direct.numerator[0].setConstant(2e-6);
  problem.model.submodels.push_back(direct);
}

void leave_out_rigid_body(test::DenseProblem& problem) {
  problem.model.submodels.erase(problem.model.submodels.begin());
}

void delay_by_many_samples(test::DenseProblem& problem) {
  problem.model.input_delay_s.setConstant(4e-4);
}

INSTANTIATE_TEST_SUITE_P(
    Structures, SearchBudget,
    testing::Values(BudgetCase{"general_damping", add_general_damping, "--damping general"},
                    BudgetCase{"direct_term", add_direct_term, "--direct-term full"},
                    BudgetCase{"no_rigid_body", leave_out_rigid_body, "--rigid-body none"},
                    BudgetCase{"delay", delay_by_many_samples, "--delay estimate"},
                    BudgetCase{"nothing", [](test::DenseProblem&) {},
                               "No other structure fits better"}),
    [](const auto& one) { return one.param.name; });

TEST(SearchLimit, AnAxisThatWasNotExcitedIsNamed) {
  FrfEstimate frf = measured(6, [](test::DenseProblem&) {});
  test::RandomNumbers random(7);
  for (Eigen::Index c = 4; c < 6; ++c)
    for (Eigen::Index k = 0; k < frf.lines(); ++k) {
      frf.noise_variance(c, k) = 1e-16;
      frf.response(c, k) = 1e-8 * random.circular();
    }
  const FitResult fit = automatic_fit(frf, {}, with_budget(kTinyBudget_s), weighed());
  EXPECT_THAT(fit.message(), testing::HasSubstr("The response of a3 is below its noise"));
  EXPECT_THAT(fit.message(), testing::HasSubstr("'frf --inputs a1,a2'"));
}

TEST(SearchLimit, TheBudgetIsWorkAndNotTime) {
  const FrfEstimate frf = measured(8, add_general_damping);
  FitResult fits[2];
  for (const int threads : {1, 2}) {
    FitOptions options = weighed();
    options.threads = threads;
    fits[threads - 1] = automatic_fit(frf, {}, with_budget(0.003), options);
  }
  EXPECT_EQ(fits[0].status(), FitStatus::search_budget) << fits[0].message();
  EXPECT_EQ(fits[0].cost, fits[1].cost);
  EXPECT_EQ(fits[0].message(), fits[1].message());
  EXPECT_EQ(fits[0].decisions, fits[1].decisions);
}

TEST(SearchLimit, AnEnoughBudgetChangesNothing) {
  const FrfEstimate frf = measured(9, [](test::DenseProblem&) {});
  const FitResult bounded = automatic_fit(frf, {}, {}, weighed());
  const FitResult unbounded = automatic_fit(frf, {}, with_budget(0.0), weighed());
  EXPECT_TRUE(bounded.trustworthy()) << bounded.message();
  EXPECT_EQ(bounded.cost, unbounded.cost);
}

// A requested number of modes is fitted without a budget.
TEST(SearchLimit, ModesThatAreAskedForHaveNoBudget) {
  const FrfEstimate frf = measured(10, [](test::DenseProblem&) {});
  ModeSelection selection = with_budget(kTinyBudget_s);
  selection.exactly = 3;
  const FitResult fit = automatic_fit(frf, {}, selection, weighed());
  EXPECT_TRUE(fit.trustworthy()) << fit.message();
}

TEST(SearchLimit, AnInterruptKeepsTheBestModelSoFar) {
  const FrfEstimate frf = measured(11, add_general_damping);
  double last_cost = HUGE_VAL;
  for (const int steps : {1, 10, 100}) {
    int looked = 0;
    FitOptions options = weighed();
    options.interrupted = [&] { return ++looked > steps; };
    const FitResult fit = automatic_fit(frf, {}, {}, options);
    EXPECT_EQ(fit.status(), FitStatus::interrupted) << fit.message();
    EXPECT_THAT(fit.message(), testing::StartsWith("interrupted"));
    expect_whole(fit);
    EXPECT_LE(fit.model.fit.cost, last_cost);
    last_cost = fit.model.fit.cost;
  }
}

}  // namespace stageid::test_search_limit
