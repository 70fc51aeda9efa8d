#include "estimation/modal/mode_shapes.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>

#include "tests/support/models/model_fit_problem.hpp"

namespace stageid::test_mode_shapes {

using Complex = std::complex<double>;

constexpr double kFrequency_hz = 120.0;
constexpr double kDamping = 0.03;
constexpr double kOmega_rad_s = 2.0 * std::numbers::pi * kFrequency_hz;

AdditiveModel mode_model(int outputs, int inputs, int matrices) {
  AdditiveModel model = test::named_model(outputs, inputs);
  model.submodels = {test::empty_submodel(model, 0, {}, 1),
                     test::empty_mode(model, kFrequency_hz, kDamping, matrices)};
  return model;
}

TEST(ModalForm, OfAMechanicalModeIsItsShapesAndMass) {
  AdditiveModel model = mode_model(2, 3, 1);
  const Eigen::VectorXd phi{{0.6, -0.8}};
  const Eigen::VectorXd psi{{2.0 / 3.0, 2.0 / 3.0, -1.0 / 3.0}};
  const double mass = 7.0;
  model.submodels[1].numerator[0] = phi * psi.transpose() / (mass * kOmega_rad_s * kOmega_rad_s);
  const std::vector<ModeShape> modes = mode_shapes(model);
  ASSERT_EQ(modes.size(), 1U);
  EXPECT_EQ(modes[0].submodel, 1U);
  EXPECT_NEAR(modes[0].natural_frequency_hz, kFrequency_hz, 1e-12 * kFrequency_hz);
  EXPECT_NEAR(modes[0].damping_ratio, kDamping, 1e-14);
  EXPECT_NEAR(modes[0].modal_mass, mass, 1e-13 * mass);
  // The largest output component is positive, so both shapes are turned.
  EXPECT_LT((modes[0].output_shape + phi).norm(), 1e-14);
  EXPECT_LT((modes[0].input_shape + psi).norm(), 1e-14);
  EXPECT_LT(modes[0].not_rank_one, 1e-14);
  // Seen at output 1 and input 1: mass over the product of their components.
  EXPECT_NEAR(driving_point_mass(modes[0], {1, 2}), mass / (0.8 / 3.0), 1e-12 * mass);
  EXPECT_LT(driving_point_mass(modes[0], {1, 0}), 0.0);
}

TEST(ModalForm, OfAGeneralViscousModeGivesItsResponseBack) {
  AdditiveModel model = mode_model(2, 2, 2);
  const Complex pole = kOmega_rad_s * Complex(-kDamping, std::sqrt(1.0 - kDamping * kDamping));
  const Eigen::VectorXcd phi{{Complex(0.3, 0.1), Complex(-1.0, 0.4)}};
  const Eigen::VectorXcd psi{{Complex(1.0, -0.2), Complex(0.5, 0.3)}};
  const Eigen::MatrixXcd residue = phi * psi.transpose();
  const double a2 = model.submodels[1].denominator[2];
  model.submodels[1].numerator[0] = -2.0 * a2 * (std::conj(pole) * residue).real();
  model.submodels[1].numerator[1] = 2.0 * a2 * residue.real();
  const ModeShape mode = mode_shapes(model).at(0);
  EXPECT_LT(mode.not_rank_one, 1e-13);
  EXPECT_NEAR(mode.output_shape[1].imag(), 0.0, 1e-15);
  EXPECT_GT(mode.output_shape[1].real(), 0.0);
  EXPECT_NEAR(mode.output_shape.norm(), 1.0, 1e-14);

  const Eigen::VectorXd lines{{10.0, 119.0, 500.0}};
  const Eigen::MatrixXcd expected = test::reference_response(model, lines, HoldModel::none);
  const Eigen::MatrixXcd found = mode.output_shape * mode.input_shape.transpose() /
                                 (mode.modal_mass * 2.0 * Complex(0.0, pole.imag()));
  for (Eigen::Index k = 0; k < lines.size(); ++k) {
    const Complex s(0.0, 2.0 * std::numbers::pi * lines[k]);
    const Eigen::MatrixXcd P = found / (s - pole) + found.conjugate() / (s - std::conj(pole));
    EXPECT_LT((P.reshaped() - expected.col(k)).norm(), 1e-12 * expected.col(k).norm());
  }
}

TEST(ModalForm, TellsHowFarAFreeResidueIsFromRankOne) {
  AdditiveModel model = mode_model(2, 2, 1);
  model.submodels[1].numerator[0] = Eigen::MatrixXd{{2.0, 0.0}, {0.0, -0.5}};
  const ModeShape mode = mode_shapes(model).at(0);
  EXPECT_NEAR(mode.not_rank_one, 0.25, 1e-15);
  EXPECT_NEAR(mode.modal_mass, model.submodels[1].denominator[2] / 2.0, 1e-20);
}

TEST(ModalForm, AnOverdampedModeIsDescribedAtItsSlowerPole) {
  // 1/((1 + s)(1 + s/100)): at s = -1, B_0 + B_1 s is rank one, at s = -100 another.
  AdditiveModel model = test::named_model(2, 2);
  model.submodels = {test::empty_submodel(model, 0, {1.01, 0.01}, 2)};
  model.submodels[0].numerator[0] = Eigen::MatrixXd{{2.0, 0.0}, {0.0, 1.0}};
  model.submodels[0].numerator[1] = Eigen::MatrixXd{{0.0, 0.0}, {0.0, 1.0}};
  const ModeShape mode = mode_shapes(model).at(0);
  EXPECT_LT(mode.not_rank_one, 1e-12);
  EXPECT_NEAR(mode.output_shape[0].real(), 1.0, 1e-14);
}

TEST(ModalForm, WithoutResidueThereIsNoShapeAndNoDrivingPointOutsideTheModel) {
  const ModeShape mode = mode_shapes(mode_model(2, 2, 1)).at(0);
  EXPECT_EQ(mode.modal_mass, std::numeric_limits<double>::infinity());
  EXPECT_EQ(mode.output_shape.norm(), 0.0);
  EXPECT_EQ(mode.not_rank_one, 0.0);
  for (const DrivingPoint& point : {DrivingPoint{2, 0}, {0, 3}, {-1, 0}, {0, -1}})
    EXPECT_THROW(driving_point_mass(mode, point), std::invalid_argument);
}

AdditiveModel rigid_model() {
  AdditiveModel model = mode_model(3, 3, 1);
  model.submodels[0] = test::empty_submodel(model, 2, {}, 1);
  // Orthonormal shapes of two degrees of freedom, 4 and 10 kg.
  const Eigen::MatrixXd output{{0.6, 0.8}, {-0.8, 0.6}, {0.0, 0.0}};
  const Eigen::MatrixXd input{{0.0, 1.0}, {1.0, 0.0}, {0.0, 0.0}};
  const Eigen::VectorXd inverse_mass{{0.25, 0.1}};
  model.submodels[0].numerator[0] = output * inverse_mass.asDiagonal() * input.transpose();
  return model;
}

TEST(RigidBody, HasAMassAndTwoShapesForEachDegreeOfFreedom) {
  const RigidBody body = rigid_body(rigid_model());
  ASSERT_EQ(body.rank(), 2);
  EXPECT_NEAR(body.mass[0], 4.0, 1e-14);
  EXPECT_NEAR(body.mass[1], 10.0, 1e-13);
  EXPECT_NEAR(body.output_shape(0, 0), -0.6, 1e-14);
  EXPECT_NEAR(body.output_shape(1, 0), 0.8, 1e-14);
  EXPECT_NEAR(body.input_shape(1, 0), -1.0, 1e-14);
  EXPECT_NEAR(body.input_shape(0, 1), 1.0, 1e-14);
}

TEST(RigidBody, IsTheSumOfAllDoubleIntegrators) {
  EXPECT_EQ(rigid_body(mode_model(2, 2, 1)).rank(), 0);
  AdditiveModel model = rigid_model();
  model.submodels.push_back(model.submodels[0]);
  const RigidBody body = rigid_body(model);
  ASSERT_EQ(body.rank(), 2);
  EXPECT_NEAR(body.mass[0], 2.0, 1e-14);
  model.submodels.pop_back();
  model.submodels[0].residue_rank = 1;  // contradicts it
  EXPECT_THROW(rigid_body(model), std::invalid_argument);
}

}  // namespace stageid::test_mode_shapes
