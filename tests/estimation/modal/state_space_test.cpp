#include "estimation/modal/state_space.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/estimation/basis_cases.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/stages/random_stage.hpp"
#include "tests/support/stages/state_space_response.hpp"

namespace stageid::test_state_space {

using Complex = std::complex<double>;
using testing::AllOf;
using testing::HasSubstr;
using testing::Property;
using testing::Throws;

/// One submodel with full numerators. Powers of s are scaled so that each matters at the poles.
AdditiveModel model_of(const test::basis::Case& c, int degree) {
  test::RandomNumbers random(7);
  AdditiveModel model = test::named_model(2, 3);
  Submodel s = test::empty_submodel(model, c.integrators, c.a(), degree + 1);
  const double omega = c.poles.empty() ? 1000.0 : std::abs(c.poles[0]);
  for (std::size_t m = 0; m < s.numerator.size(); ++m)
    s.numerator[m] = random_matrix(random, 2, 3) * std::pow(omega, -static_cast<double>(m));
  model.submodels = {s};
  return model;
}

TEST(StateSpace, EverySubmodelTheFileAllowsHasItsResponse) {
  const Eigen::VectorXd lines = test::basis::lines_hz();
  for (const test::basis::Case& c : test::basis::cases())
    for (int degree = 0; degree <= c.integrators + c.shape().order; ++degree) {
      SCOPED_TRACE(c.name + ", degree " + std::to_string(degree));
      const AdditiveModel model = model_of(c, degree);
      const StateSpace system = state_space(model);
      const Eigen::MatrixXcd expected = test::reference_response(model, lines, HoldModel::none);
      // Partial fractions cancel where a function has zeros at the origin or far below its poles:
      // 3.3e-13 at worst here.
      EXPECT_LT(test::largest_deviation(test::response_of(system, lines), expected), 1e-12);
    }
}

/// A stage as the paper's: 4 x 13, rigid body of rank 3, 17 modes of rank one.
AdditiveModel paper_model() {
  test::RandomStageSpec spec;
  spec.least_modes = spec.most_modes = 17;
  return test::draw_random_stage(3, spec).truth;
}

TEST(StateSpace, StageOfThePaperHasFortyStates) {
  const AdditiveModel model = paper_model();
  const StateSpace system = state_space(model);
  EXPECT_EQ(system.order(), 2 * 3 + 17 * 2);
  const Eigen::VectorXd lines = Eigen::VectorXd::LinSpaced(500, 1.0, 5000.0);
  AdditiveModel undelayed = model;
  undelayed.input_delay_s.setZero();
  EXPECT_LT(test::largest_deviation(test::response_of(system, lines),
                                    response(undelayed, lines, HoldModel::none)),
            1e-12);
}

TEST(StateSpace, FreeResiduesHaveStatesForEveryRank) {
  test::RandomNumbers random(3);
  AdditiveModel model = paper_model();
  for (Submodel& s : model.submodels)
    s.numerator[0] += 1e-4 * s.numerator[0].norm() * random_matrix(random, 4, 13);
  EXPECT_EQ(state_space(model).order(), 4 * 2 + 17 * 4 * 2);
}

/// Rigid body of rank one with a second direction in 1/s alone, a general viscous mode of rank one and
/// a real pole of rank two.
AdditiveModel small_model() {
  test::RandomNumbers random(11);
  AdditiveModel model = test::named_model(2, 3);
  Submodel rigid = test::empty_submodel(model, 2, {}, 2);
  rigid.numerator[0] = random_matrix(random, 2, 1) * random_matrix(random, 1, 3);
  rigid.numerator[1] = random_matrix(random, 2, 3);
  Submodel mode = test::empty_submodel(model, 0, {0.02, 0.8}, 2);
  const Complex pole = Complex(-0.02, std::sqrt(4.0 * 0.8 - 0.0004)) / 1.6;
  const Eigen::MatrixXcd residue =
      (random_matrix(random, 2, 1) + Complex(0.0, 1.0) * random_matrix(random, 2, 1)) *
      (random_matrix(random, 1, 3) + Complex(0.0, 1.0) * random_matrix(random, 1, 3));
  mode.numerator[0] = -1.6 * (std::conj(pole) * residue).real();
  mode.numerator[1] = 1.6 * residue.real();
  Submodel lag = test::empty_submodel(model, 0, {0.5}, 1);
  lag.numerator[0] = random_matrix(random, 2, 3);
  model.submodels = {rigid, mode, lag};
  return model;
}

TEST(StateSpace, IsMinimal) {
  const StateSpace system = state_space(small_model());
  // 1/s^2: 2; 1/s outside its row and column: 2 x 3 less one of each has rank 1; mode: 2; lag: 2.
  ASSERT_EQ(system.order(), 2 + 1 + 2 + 2);
  EXPECT_GT(test::controllability(system.A, system.B), 1e-6);
  EXPECT_GT(test::controllability(system.A.transpose(), system.C.transpose()), 1e-6);
  // The measure would notice: one state more that repeats another.
  Eigen::MatrixXd B = system.B;
  B.row(5) = B.row(6);
  EXPECT_LT(test::controllability(system.A, B), 1e-12);
}

TEST(StateSpace, BlocksTellPolesAndSubmodels) {
  const AdditiveModel model = small_model();
  const StateSpace system = state_space(model);
  ASSERT_EQ(system.blocks.size(), 5U);
  EXPECT_EQ(system.A.block(0, 0, 2, 2), (Eigen::MatrixXd{{0.0, 1.0}, {0.0, 0.0}}));
  Eigen::Index next = 0;
  Eigen::MatrixXd rest = system.A;
  for (const StateBlock& block : system.blocks) {
    EXPECT_EQ(block.first, next);
    next += block.size;
    EXPECT_NEAR(system.A(block.first, block.first), block.pole.real(), 1e-15);
    rest.block(block.first, block.first, block.size, block.size).setZero();
  }
  EXPECT_EQ(next, system.order());
  EXPECT_EQ(rest.norm(), 0.0);
  EXPECT_EQ(system.blocks[2].submodel, 1);
  EXPECT_NEAR(std::abs(system.blocks[2].pole), std::sqrt(1.0 / 0.8), 1e-14);
  EXPECT_EQ(system.blocks[3].submodel, 2);
  EXPECT_EQ(system.blocks[3].pole, Complex(-2.0, 0.0));
}

TEST(StateSpace, SubmodelsMayShareAPole) {
  test::RandomNumbers random(2);
  AdditiveModel model = test::named_model(2, 3);
  model.submodels.assign(2, test::empty_mode(model, 100.0, 0.01));
  for (Submodel& mode : model.submodels)
    mode.numerator[0] = random_matrix(random, 2, 1) * random_matrix(random, 1, 3);
  const StateSpace system = state_space(model);
  EXPECT_EQ(system.order(), 4);
  const Eigen::VectorXd lines{{50.0, 100.0, 400.0}};
  EXPECT_LT(test::largest_deviation(test::response_of(system, lines),
                                    test::reference_response(model, lines, HoldModel::none)),
            1e-12);
}

TEST(StateSpace, HeldRankCutsRoundingOff) {
  // As a program that stores numbers in single precision would pass a rank-one residue on.
  test::RandomNumbers random(2);
  AdditiveModel model = test::named_model(3, 3);
  Submodel mode = test::empty_mode(model, 100.0, 0.01);
  mode.numerator[0] = random_matrix(random, 3, 1) * random_matrix(random, 1, 3);
  mode.numerator[0] = mode.numerator[0].cast<float>().cast<double>().eval();
  model.submodels = {mode};
  EXPECT_EQ(state_space(model).order(), 6);
  model.submodels[0].residue_rank = 1;
  EXPECT_EQ(state_space(model).order(), 2);
}

AdditiveModel lag_model(std::vector<double> a, int integrators, int matrices) {
  AdditiveModel model = test::named_model(1, 1);
  model.submodels = {test::empty_submodel(model, 0, {1.0}, 1),
                     test::empty_submodel(model, integrators, std::move(a), matrices)};
  return model;
}

auto refuses(const std::string& what) {
  return Throws<std::invalid_argument>(
      Property(&std::invalid_argument::what, AllOf(HasSubstr("submodel 1"), HasSubstr(what))));
}

TEST(StateSpace, RefusesWhatHasNoneInThisForm) {
  // (1 + s)^2, a critically damped mode, and (1 + s)^2 (1 + s/5)
  EXPECT_THAT([] { state_space(lag_model({2.0, 1.0}, 0, 1)); }, refuses("coincide"));
  EXPECT_THAT([] { state_space(lag_model({2.2, 1.4, 0.2}, 0, 1)); }, refuses("coincide"));
  EXPECT_THAT([] { state_space(lag_model({}, 3, 1)); }, refuses("integrators"));
  EXPECT_THAT([] { state_space(lag_model({1.0}, 0, 3)); }, refuses("must be proper"));
  EXPECT_THAT([] { state_space(lag_model({1.0}, 0, 0)); }, refuses("numerator"));
}

TEST(StateSpace, RefusesARankThatContradictsTheNumerators) {
  AdditiveModel model = test::named_model(2, 2);
  model.submodels = {test::empty_submodel(model, 0, {}, 1), test::empty_submodel(model, 2, {}, 1)};
  model.submodels[1].numerator[0] = Eigen::MatrixXd{{1.0, 0.0}, {0.0, 0.1}};
  model.submodels[1].residue_rank = 1;
  EXPECT_THAT([&] { state_space(model); }, refuses("residue_rank is 1"));
}

}  // namespace stageid::test_state_space
