#include "estimation/fit/mode_worth.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace stageid::test_mode_worth {

constexpr Eigen::Index kLines = 100;

FrfEstimate frf_of(Eigen::Index side) {
  FrfEstimate frf;
  frf.frequency_hz.setLinSpaced(kLines, 1.0, kLines);
  frf.response.setOnes(side * side, kLines);
  return frf;
}

/// One mode, and a part with `more` parameters that lowers 2 ln(likelihood) by `gain`.
FitResult fit_of(Eigen::Index side, const Submodel& part, Eigen::Index more, double gain) {
  const Eigen::MatrixXd B = Eigen::MatrixXd::Ones(side, side);
  FitResult fit;
  fit.model.submodels = {{0, {1.0, 1e-3, 1e-2}, {B}, {}, {}}};
  fit.parameters = 2 + side * side;
  fit.model.fit.cost = 1.0;
  if (more == 0) return fit;
  if (part.denominator.empty())
    fit.model.submodels[0].numerator.push_back(B);
  else
    fit.model.submodels.push_back(part);
  fit.parameters += more;
  fit.model.fit.cost = std::exp(-gain / (2.0 * static_cast<double>(side * side * kLines)));
  return fit;
}

const Submodel kDirectTerm{0, {1.0}, {Eigen::MatrixXd::Ones(1, 1)}, {}, {}};

bool is_worth(const ModeWorth& worth, double gain) {
  return worth.criterion(fit_of(1, kDirectTerm, 1, gain)) <
         worth.criterion(fit_of(1, kDirectTerm, 0, 0.0));
}

TEST(ModeWorth, APartOfFewParametersMustGainMoreThanNoiseCan) {
  const ModeWorth worth(frf_of(1));
  const double most_by_noise = 1.0 + 5.0 * std::sqrt(2.0);
  EXPECT_FALSE(is_worth(worth, most_by_noise - 0.1));
  EXPECT_TRUE(is_worth(worth, most_by_noise + 0.1));
}

TEST(ModeWorth, APartOfHundredsOfParametersMustGainTwiceTheirNumber) {
  const FrfEstimate frf = frf_of(20);
  const ModeWorth worth(frf);
  const double without = worth.criterion(fit_of(20, {}, 0, 0.0));
  EXPECT_GT(worth.criterion(fit_of(20, {}, 400, 799.0)), without);
  EXPECT_LT(worth.criterion(fit_of(20, {}, 400, 801.0)), without);
}

// A gain of g on a fifth of the lines, of which noise gives 1, is one of 5 (g - 1) + 1 on all.
TEST(ModeWorth, AGainOnSomeLinesIsJudgedByWhatAllWouldShow) {
  const FrfEstimate frf = frf_of(1);
  const ModeWorth worth(frf, {}, Eigen::MatrixXd::Ones(1, kLines), 5 * kLines);
  const double enough = 1.0 + std::sqrt(2.0);
  EXPECT_FALSE(is_worth(worth, enough - 0.05));
  EXPECT_TRUE(is_worth(worth, enough + 0.05));
}

TEST(ModeWorth, TheCostAtACriterionIsThatOfTheFitWithIt) {
  const FrfEstimate frf = frf_of(1);
  const ModeWorth worth(frf, {}, Eigen::MatrixXd::Ones(1, kLines), 5 * kLines);
  const FitResult fit = fit_of(1, kDirectTerm, 1, 3.0);
  EXPECT_NEAR(worth.cost_at(worth.criterion(fit), fit.model, fit.parameters), fit.model.fit.cost,
              1e-12);
}

}  // namespace stageid::test_mode_worth
