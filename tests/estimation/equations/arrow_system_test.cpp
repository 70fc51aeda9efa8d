// One step of the iteration, against the paper's equations written out densely, and the gradient
// against finite differences of a cost computed elsewhere.

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "estimation/equations/arrow_system.hpp"
#include "estimation/problem/residual.hpp"
#include "tests/estimation/correlated_stage.hpp"
#include "tests/estimation/disturbed_problem.hpp"

namespace stageid::test_arrow_system {

using test::DenseProblem;
using test::measure_and_disturb;
using test::random_matrix;
using test::RandomNumbers;

constexpr double kEps = std::numeric_limits<double>::epsilon();

/// 2 x 2: rigid body, a mode, a mode with B_0 + B_1 s; rad/s of order one, so that the dense equations are well
/// conditioned without scaling.
DenseProblem stage_problem(std::uint64_t seed) {
  RandomNumbers random(seed);
  DenseProblem problem;
  problem.model = test::named_model(2, 2);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(60, 0.03, 0.6);
  problem.model.submodels = {test::empty_submodel(problem.model, 2, {}, 1),
                             test::empty_mode(problem.model, 0.15, 0.06),
                             test::empty_mode(problem.model, 0.37, 0.04, 2)};
  measure_and_disturb(random, problem, 1.0);
  return problem;
}

/// 3 x 2 with less common submodels: an integrator with a lag, first-order, third-order, a constant.
DenseProblem general_problem(std::uint64_t seed) {
  RandomNumbers random(seed);
  DenseProblem problem;
  problem.model = test::named_model(3, 2);
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(50, 0.03, 0.6);
  problem.model.submodels = {test::empty_submodel(problem.model, 1, {0.8}, 2),
                             test::empty_submodel(problem.model, 0, {2.5}, 1),
                             test::empty_submodel(problem.model, 0, {}, 1),
                             test::empty_submodel(problem.model, 0, {0.7, 0.3, 0.05}, 2)};
  measure_and_disturb(random, problem, 1.0);
  return problem;
}

/// The library's step in the order of the paper's beta.
Eigen::VectorXd library_step(const DenseProblem& problem, FitMethod method) {
  const auto [fit, beta, groups] = test::Evaluated(problem);
  const ArrowSystem system(fit, beta, groups, method);
  EXPECT_TRUE(system.regular());
  const Eigen::VectorXd step = system.solve_globals(0.0);
  const std::vector<Eigen::Index> first = test::first_of_theta(problem.model);
  Eigen::VectorXd out(first.back());
  Eigen::Index global = 0;
  Eigen::Index function = 0;
  for (std::size_t i = 0; i < fit.shapes.size(); ++i) {
    Eigen::Index at = first[i];
    for (int q = 0; q < fit.shapes[i].order; ++q) out[at++] = step[global++];
    for (int m = 0; m < fit.shapes[i].functions(); ++m)
      for (Eigen::Index c = 0; c < problem.channels(); ++c)
        out[at++] =
            system.channel(c).x[function + m] - system.channel(c).Z.row(function + m).dot(step);
    function += fit.shapes[i].functions();
  }
  return out;
}

/// Largest difference of two vectors, each entry over the larger of its own size and its step.
double difference(const Eigen::VectorXd& a, const Eigen::VectorXd& b, const Eigen::VectorXd& size) {
  return ((a - b).cwiseAbs().array() / size.cwiseAbs().array().max(1e-3)).maxCoeff();
}

// Both sides solve normal equations of condition below 1e6 (rad/s of order one): rounding is below
// 1e-10, and anything that is not the same equation shows in the first digits.
constexpr double kSameEquation = 1e-8;

TEST(FitStep, IsThatOfTheEquationsWrittenOutDensely) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed)
    for (const DenseProblem& problem : {stage_problem(seed), general_problem(seed)}) {
      SCOPED_TRACE(seed);
      const Eigen::VectorXd beta = test::beta_of(problem.model);
      // The block diagonal of the paper's matrix equation; sk has the regressor as instrument.
      const std::pair<FitMethod, Eigen::VectorXd> steps[] = {
          {FitMethod::riv, test::paper_step(problem, test::Left::instrument).next_beta - beta},
          {FitMethod::sk, test::paper_step(problem, test::Left::regressor).next_beta - beta},
          {FitMethod::gn, test::gauss_newton_step(problem)}};
      for (const auto& [method, step] : steps) {
        EXPECT_LT(difference(library_step(problem, method), step, beta), kSameEquation)
            << to_string(method);
        // Not because nothing moves: the step is of the size of the disturbance.
        EXPECT_GT(step.norm(), 0.01 * beta.norm());
        for (const auto& [other, other_step] : steps)
          EXPECT_TRUE(other == method || difference(step, other_step, beta) > 1e-3);
      }
    }
}

// The off-diagonal blocks of the paper's solution are blocks of M^-1 r, which are zero only at the end. If they were
// zero here, the identity would be tested at a fixed point.
TEST(FitStep, ThePapersOffDiagonalBlocksAreNotZeroAwayFromTheFixedPoint) {
  const DenseProblem problem = stage_problem(5);
  const test::PaperStep paper = test::paper_step(problem, test::Left::instrument);
  const std::vector<Eigen::Index> first = test::first_of_theta(problem.model);
  EXPECT_GT(paper.solution.col(0).segment(first[1], first[2] - first[1]).norm(), 1e-3);
}

TEST(FitStep, InstrumentAndRegressorAreAlikeOnlyWithoutResidual) {
  DenseProblem problem = stage_problem(6);
  test::measure(problem);
  for (Eigen::Index k = 0; k < problem.G.cols(); ++k)
    EXPECT_LT((test::instrument_rows(problem, k) - test::regressor_rows(problem, k)).norm(),
              1e-12 * test::regressor_rows(problem, k).norm());
  // And then all three are the same step, zero.
  for (const FitMethod method : {FitMethod::riv, FitMethod::gn, FitMethod::sk})
    EXPECT_LT(library_step(problem, method).norm(), 1e-10);
}

/// A 3 x 2 stage at its real scale, 10 kHz, with a delay of its own in every channel.
DenseProblem sampled_problem(std::uint64_t seed, HoldModel hold) {
  RandomNumbers random(seed);
  DenseProblem problem;
  problem.model = test::named_model(3, 2);
  problem.model.sample_rate_hz = 1e4;
  problem.hold = hold;
  problem.frequency_hz = Eigen::VectorXd::LinSpaced(80, 40.0, 2000.0);
  problem.model.input_delay_s = Eigen::VectorXd{{1.3e-4, 0.9e-4}};
  problem.model.output_delay_s = Eigen::VectorXd{{0.2e-4, 0.45e-4, 0.07e-4}};
  problem.model.submodels = {test::empty_submodel(problem.model, 2, {}, 1),
                             test::empty_mode(problem.model, 310.0, 0.03),
                             test::empty_mode(problem.model, 940.0, 0.02, 2)};
  measure_and_disturb(random, problem, 1e-3);
  return problem;
}

/// -N times the derivative of the reference cost when `change(model, h)` moves one parameter by h
/// of its size, and a bound of its error.
template <typename Change>
std::pair<double, double> slope_of_cost(const DenseProblem& problem, double h,
                                        const Change& change) {
  const auto cost = [&](double by) {
    AdditiveModel model = problem.model;
    change(model, by);
    return test::reference_cost(model, problem.frequency_hz, problem.hold, problem.G, problem.W);
  };
  const auto slope = [&](double step) { return (cost(step) - cost(-step)) / (2.0 * step); };
  const double fine = slope(h);
  const double value = fine + (fine - slope(2.0 * h)) / 3.0;
  const auto N = static_cast<double>(problem.G.cols());
  // Rounding: the cost sums 2 N n_c squares, each with a few eps of its own.
  const double rounding = 20.0 * kEps * cost(0.0) / h;
  return {-N * value, N * (0.1 * std::abs(value - fine) + rounding)};
}

void expect_gradient(const DenseProblem& problem, DelayModel delay) {
  const auto [fit, beta, groups] = test::Evaluated(problem, delay);
  const double cost =
      test::reference_cost(problem.model, problem.frequency_hz, problem.hold, problem.G, problem.W);
  EXPECT_NEAR(residual_cost(fit, groups, beta.B), cost, 1e-12 * cost);
  for (const FitMethod method : {FitMethod::riv, FitMethod::gn}) {
    const ArrowSystem system(fit, beta, groups, method);
    const Eigen::VectorXd& e = system.e_globals();
    Eigen::Index p = 0;
    for (std::size_t i = 0; i < problem.model.submodels.size(); ++i)
      for (std::size_t q = 1; q < problem.model.submodels[i].denominator.size(); ++q, ++p) {
        const double size = problem.model.submodels[i].denominator[q];
        const auto [expected, error] = slope_of_cost(
            problem, 1e-5,
            [&](AdditiveModel& model, double h) { model.submodels[i].denominator[q] *= 1.0 + h; });
        EXPECT_NEAR(e[p] * size, expected, error) << "submodel " << i << ", a_" << q;
        EXPECT_GT(std::abs(expected), 10.0 * error) << "the difference decides nothing";
      }
    const double time = 1e-4;
    std::vector<Eigen::VectorXd> moved;  // input delays, then output delays but the last
    if (delay == DelayModel::estimate) {
      moved.push_back(Eigen::VectorXd::Ones(5));
      moved.back().tail(3).setZero();
    } else if (delay == DelayModel::per_channel) {
      for (Eigen::Index d = 0; d < 4; ++d) moved.push_back(Eigen::VectorXd::Unit(5, d));
    }
    ASSERT_EQ(e.size(), p + std::ssize(moved));
    for (const Eigen::VectorXd& direction : moved) {
      const auto [expected, error] =
          slope_of_cost(problem, 1e-4, [&](AdditiveModel& model, double h) {
            model.input_delay_s += h * time * direction.head(2);
            model.output_delay_s += h * time * direction.tail(3);
          });
      EXPECT_NEAR(e[p] * time, expected, error) << "delay along " << direction.transpose();
      EXPECT_GT(std::abs(expected), 10.0 * error) << "the difference decides nothing";
      ++p;
    }
    for (Eigen::Index c = 0; c < problem.channels(); ++c) {
      Eigen::Index f = 0;
      for (std::size_t i = 0; i < problem.model.submodels.size(); ++i)
        for (std::size_t m = 0; m < problem.model.submodels[i].numerator.size(); ++m, ++f) {
          const double size = problem.model.submodels[i].numerator[m].reshaped()[c];
          // Quadratic in a numerator: any step is exact, and a large one rounds least.
          const auto [expected, error] =
              slope_of_cost(problem, 0.5, [&](AdditiveModel& model, double h) {
                model.submodels[i].numerator[m].reshaped()[c] *= 1.0 + h;
              });
          EXPECT_NEAR(system.channel(c).e[f] * size, expected, error + 1e-10 * std::abs(expected))
              << "channel " << c << ", function " << f;
        }
    }
  }
}

TEST(FitGradient, IsThatOfTheCost) {
  expect_gradient(stage_problem(11), DelayModel::fixed);
  expect_gradient(general_problem(12), DelayModel::fixed);
  for (const HoldModel hold : {HoldModel::none, HoldModel::sinc, HoldModel::exact})
    expect_gradient(sampled_problem(13, hold), DelayModel::estimate);
  for (const HoldModel hold : {HoldModel::none, HoldModel::phase, HoldModel::exact})
    expect_gradient(sampled_problem(14, hold), DelayModel::per_channel);
}

TEST(FitStep, TheArrowWithDelaysSolvesItsOwnDenseEquations) {
  // The dense Jacobian of all parameters by differences of the reference response, Gauss-Newton.
  const DenseProblem problem = sampled_problem(15, HoldModel::exact);
  const auto [fit, beta, groups] = test::Evaluated(problem, DelayModel::per_channel);
  const Eigen::VectorXd step = ArrowSystem(fit, beta, groups, FitMethod::gn).solve_globals(0.0);
  const test::DenseEquations dense = test::dense_equations(
      problem, problem.G, DelayModel::per_channel, [&](std::size_t k) -> Eigen::MatrixXcd {
        return problem.W.col(k).asDiagonal().toDenseMatrix();
      });
  const Eigen::VectorXd expected = test::scaled_inverse(dense.M) * dense.e;
  // The error of the finite differences is 1e-9 of a column.
  for (Eigen::Index i = 0; i < fit.globals(); ++i)
    EXPECT_NEAR(step[i], expected[i], 1e-6 * std::abs(expected[i])) << i;
}

}  // namespace stageid::test_arrow_system
