#include "estimation/modal/modal_assurance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test_modal_assurance {

using Complex = std::complex<double>;

TEST(ModalAssurance, IsTheSquaredCosineOfShapes) {
  const Eigen::MatrixXcd a{{1.0, 1.0}, {0.0, 1.0}};
  const Eigen::MatrixXcd b{{Complex(0.0, 2.0), 3.0, 0.0}, {0.0, -3.0, 0.0}};
  const Eigen::MatrixXd mac = modal_assurance(a, b);
  ASSERT_EQ(mac.rows(), 2);
  ASSERT_EQ(mac.cols(), 3);
  EXPECT_NEAR(mac(0, 0), 1.0, 1e-15);  // a multiple, whatever its phase
  EXPECT_NEAR(mac(0, 1), 0.5, 1e-15);  // 45 degrees
  EXPECT_NEAR(mac(1, 0), 0.5, 1e-15);
  EXPECT_EQ(mac(1, 1), 0.0);  // orthogonal
  EXPECT_EQ(mac(0, 2), 0.0);  // nothing
}

TEST(ModalAssurance, TellsAComplexShapeFromItsConjugateOfTheSameChannels) {
  const Eigen::MatrixXcd a{{1.0}, {Complex(0.0, 1.0)}};
  EXPECT_NEAR(modal_assurance(a, a)(0, 0), 1.0, 1e-15);
  EXPECT_EQ(modal_assurance(a, a.conjugate())(0, 0), 0.0);
  EXPECT_THROW(modal_assurance(Eigen::MatrixXcd::Ones(2, 1), Eigen::MatrixXcd::Ones(3, 1)),
               std::invalid_argument);
}

TEST(ModalAssurance, OfRandomShapesIsOneOverTheChannels) {
  constexpr Eigen::Index kShapes = 60;
  test::RandomNumbers random(9);
  const Eigen::MatrixXcd a = test::random_matrix(random, 4, kShapes).cast<Complex>();
  const Eigen::MatrixXcd b = test::random_matrix(random, 4, kShapes).cast<Complex>();
  // Of one pair: variance of Beta(1/2, 3/2) = 1/16; the 3600 products have at least 60 independent.
  EXPECT_NEAR(modal_assurance(a, b).mean(), 0.25, 4.0 * 0.25 / std::sqrt(60.0));
}

ModeShape mode(double frequency_hz, const Eigen::VectorXcd& output, const Eigen::VectorXcd& input) {
  ModeShape out;
  out.natural_frequency_hz = frequency_hz;
  out.output_shape = output;
  out.input_shape = input;
  return out;
}

const Eigen::VectorXcd kX{{1.0, 0.1}};
const Eigen::VectorXcd kY{{-0.1, 1.0}};

TEST(PairModes, TellsCloseModesApartByTheirShapes) {
  const std::vector<ModeShape> first = {mode(100.0, kX, kX), mode(101.0, kY, kY),
                                        mode(300.0, kX, kY)};
  // Frequencies alone would pair 100 with 100.2 and 101 with 100.8.
  const std::vector<ModeShape> second = {mode(299.0, kX, kY), mode(100.2, kY, kY),
                                         mode(100.8, kX, kX), mode(500.0, kX, kX)};
  const std::vector<ModePair> pairs = pair_modes(first, second);
  ASSERT_EQ(pairs.size(), 3U);
  EXPECT_EQ(pairs[0].second, 2U);
  EXPECT_EQ(pairs[1].second, 1U);
  EXPECT_EQ(pairs[2].second, 0U);
  EXPECT_NEAR(pairs[0].frequency_difference, 0.008, 1e-12);
  EXPECT_NEAR(pairs[0].output_mac, 1.0, 1e-12);
  EXPECT_NEAR(pairs[0].input_mac, 1.0, 1e-12);
}

TEST(PairModes, TellsAlikeShapesApartByTheirFrequencies) {
  const std::vector<ModeShape> first = {mode(100.0, kX, kX), mode(103.0, kX, kX)};
  const std::vector<ModeShape> second = {mode(102.9, kX, kX), mode(99.5, kX, kX)};
  const std::vector<ModePair> pairs = pair_modes(first, second);
  ASSERT_EQ(pairs.size(), 2U);
  EXPECT_EQ(pairs[0].second, 1U);
  EXPECT_EQ(pairs[1].second, 0U);
}

TEST(PairModes, LeavesOutWhatIsFarOrUnlikeAndRefusesOtherChannels) {
  const std::vector<ModeShape> first = {mode(100.0, kX, kX), mode(200.0, kX, kX)};
  const std::vector<ModeShape> second = {mode(106.0, kX, kX), mode(200.0, kX, kY)};
  EXPECT_TRUE(pair_modes(first, second).empty());
  EXPECT_EQ(pair_modes(first, {mode(104.0, kX, kX), second[1]}).size(), 1U);
  EXPECT_TRUE(pair_modes(first, {}).empty());
  EXPECT_TRUE(pair_modes({}, second).empty());
  EXPECT_THROW(pair_modes(first, {mode(100.0, Eigen::VectorXcd::Ones(3), kX)}),
               std::invalid_argument);
}

}  // namespace stageid::test_modal_assurance
