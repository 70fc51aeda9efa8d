#include "estimation/loop/response_gradient.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/estimation/loop_cases.hpp"

namespace stageid::test_response_gradient {

using test::parameters_of;
using test::with_parameters;

/// Weights picking every channel.
Eigen::MatrixXcd every_channel() { return Eigen::MatrixXcd::Identity(6, 6); }

void expect_differences(const AdditiveModel& model, Eigen::Index delays) {
  const Eigen::VectorXd lines = Eigen::VectorXd{{20.0, 70.9, 188.3, 640.0}};
  const Eigen::VectorXd x = parameters_of(model, delays);
  const ResponseGradient gradient(model, x.size(), lines);
  for (Eigen::Index p = 0; p < x.size(); ++p) {
    const double step = 1e-6 * std::max(std::abs(x[p]), 1e-9);
    Eigen::VectorXd moved = x;
    moved[p] += step;
    const Eigen::MatrixXcd above =
        response(with_parameters(model, delays, moved), lines, HoldModel::exact);
    moved[p] -= 2.0 * step;
    const Eigen::MatrixXcd below =
        response(with_parameters(model, delays, moved), lines, HoldModel::exact);
    const Eigen::MatrixXcd difference = (above - below) / (2.0 * step);
    Eigen::MatrixXcd told(6, lines.size());
    for (Eigen::Index k = 0; k < lines.size(); ++k)
      told.col(k) = gradient.of(k, every_channel()).row(p).transpose();
    EXPECT_LT((told - difference).norm(), 3e-5 * difference.norm()) << "parameter " << p;
  }
}

TEST(ResponseGradient, IsTheDerivativeOfTheSampledResponse) {
  AdditiveModel model = test::model_of({});
  expect_differences(model, 0);
  expect_differences(model, 1);
  const Eigen::Index n = parameters_of(model, 0).size();
  for (const Eigen::Index other : {n + 2, n - 1})
    EXPECT_THROW(ResponseGradient(model, other, Eigen::VectorXd{{20.0}}), std::invalid_argument);
  model.input_delay_s = Eigen::VectorXd{{1.1e-4, 1.3e-4, 0.2e-4}};
  model.output_delay_s = Eigen::VectorXd{{2.9e-4, 2.1e-4}};
  expect_differences(model, 4);
}

TEST(LoopPoint, IsALoopOpenedAloneAndItsDerivative) {
  test::RandomNumbers random(8);
  const Eigen::MatrixXcd K = test::circular_matrix(random, 3, 2);
  const Eigen::MatrixXcd P = test::circular_matrix(random, 2, 4);
  LoopController controller;
  controller.actuators = test::circular_matrix(random, 4, 3).real();
  const Eigen::MatrixXcd T = controller.actuators.cast<std::complex<double>>();
  const LoopPoint point = loop_point(controller, K, P, true);
  const Eigen::MatrixXcd PT = P * T;
  const Eigen::MatrixXcd one = Eigen::MatrixXcd::Identity(2, 2);
  for (Eigen::Index k = 0; k < 3; ++k) {
    Eigen::MatrixXcd others = K;
    others.row(k).setZero();
    const Eigen::MatrixXcd closed = solve(one + PT * others, P);
    EXPECT_LT(std::abs(point.loop[k] - (K.row(k) * closed * T.col(k)).value()), 1e-12);
  }
  const Eigen::MatrixXcd L = one + PT * K;
  EXPECT_LT(std::abs(point.determinant - (L(0, 0) * L(1, 1) - L(0, 1) * L(1, 0))), 1e-12);
  for (Eigen::Index c = 0; c < P.size(); ++c) {
    const double step = 1e-6;
    Eigen::MatrixXcd moved = P;
    moved(c) += step;
    const LoopPoint above = loop_point(controller, K, moved, false);
    moved(c) -= 2.0 * step;
    const LoopPoint below = loop_point(controller, K, moved, false);
    for (Eigen::Index k = 0; k < 3; ++k)
      EXPECT_LT(std::abs((above.loop[k] - below.loop[k]) / (2.0 * step) - point.weights(c, k)),
                1e-6 * (1.0 + std::abs(point.weights(c, k))));
    EXPECT_LT(
        std::abs((above.determinant - below.determinant) / (2.0 * step) - point.weights(c, 3)),
        1e-6 * (1.0 + std::abs(point.weights(c, 3))));
  }
}

}  // namespace stageid::test_response_gradient
