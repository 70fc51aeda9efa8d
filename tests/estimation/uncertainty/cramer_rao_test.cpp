// Deviations of a fit of the paper's size, compared with the Cramer-Rao bound from differences and QR.

#include <gtest/gtest.h>

#include "estimation/fit/fit_additive_model.hpp"
#include "tests/support/models/cramer_rao_bound.hpp"
#include "tests/support/models/model_fit_problem.hpp"
#include "tests/support/stages/random_stage.hpp"

namespace stageid::test_cramer_rao {

TEST(CramerRao, IsWhatMaximumLikelihoodReportsAtTheTruth) {
  test::RandomStageSpec spec;
  spec.least_modes = spec.most_modes = 17;
  spec.line_spacing_hz = 2.0;
  test::RandomStage stage = test::draw_random_stage(5, spec);
  ASSERT_EQ(stage.pairs, 3) << "close pairs make it hard";
  stage.frf.response = stage.exact;
  stage.frf.noise_variance = stage.variance;
  stage.frf.noise_dof = 0.0;
  FitOptions options = test::fit_options(Weighting::noise_variance, HoldModel::exact,
                                         DelayModel::estimate, stage.delay_s);
  const FitResult fit = fit_additive_model(stage.frf, stage.truth, options);
  const test::CramerRaoBound bound =
      test::cramer_rao_bound(stage.truth, stage.frf.frequency_hz, HoldModel::exact, stage.variance);
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
    const Submodel& s = fit.model.submodels[i];
    const auto at = static_cast<Eigen::Index>(i);
    // Differences of step 1e-3 half-power widths: 1e-12 and their rounding 1e-13, times the
    // condition of close pairs.
    if (s.is_mode()) {
      EXPECT_NEAR(*s.natural_frequency_std_hz / bound.frequency_std_hz[at], 1.0, 1e-6);
      EXPECT_NEAR(*s.damping_ratio_std / bound.damping_std[at], 1.0, 1e-6);
    }
    const Eigen::ArrayXXd ratio = s.numerator_std.at(0).array() / bound.numerator_std[i].array();
    EXPECT_NEAR(ratio.minCoeff(), 1.0, 1e-6) << "submodel " << i;
    EXPECT_NEAR(ratio.maxCoeff(), 1.0, 1e-6) << "submodel " << i;
  }
}

}  // namespace stageid::test_cramer_rao
