#include "estimation/search/trials.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::part_of_data_test {

FrfEstimate frf_of(Eigen::Index outputs, Eigen::Index inputs, Eigen::Index lines) {
  FrfEstimate frf;
  for (Eigen::Index y = 0; y < outputs; ++y) frf.outputs.names.push_back(fmt::format("y{}", y));
  for (Eigen::Index u = 0; u < inputs; ++u) frf.inputs.names.push_back(fmt::format("u{}", u));
  frf.outputs.units.assign(static_cast<std::size_t>(outputs), "m");
  frf.inputs.units.assign(static_cast<std::size_t>(inputs), "N");
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(lines, 1.0, static_cast<double>(lines));
  test::RandomNumbers random(1);
  frf.response = circular_matrix(random, outputs * inputs, lines);
  return frf;
}

FitOptions weighed(const FrfEstimate& frf) {
  FitOptions options;
  options.user_weights = Eigen::MatrixXd(frf.response.cwiseAbs2());
  return options;
}

AdditiveModel one_mode(const FrfEstimate& frf) {
  AdditiveModel model;
  model.inputs = frf.inputs;
  model.outputs = frf.outputs;
  model.input_delay_s = Eigen::VectorXd::LinSpaced(frf.n_inputs(), 0.0, 1e-3);
  model.output_delay_s.setZero(frf.n_outputs());
  test::RandomNumbers random(2);
  model.submodels.push_back(
      {0, {1.0, 0.1, 100.0}, {random_matrix(random, frf.n_outputs(), frf.n_inputs())}, {}, {}});
  return model;
}

TEST(PartOfData, FewDataAreWhole) {
  const FrfEstimate frf = frf_of(2, 3, 900);
  const PartOfData part = part_of_data(frf, weighed(frf), one_mode(frf));
  EXPECT_TRUE(part.all);
  EXPECT_EQ(part.frf.response, frf.response);
}

TEST(PartOfData, ManyLinesAndChannelsAreTakenEvenly) {
  FrfEstimate frf = frf_of(40, 330, 1100);
  frf.correlated_lines = 3.0;
  AdditiveModel model = one_mode(frf);
  model.output_delay_s.setLinSpaced(40, 2e-4, 0.0);
  const PartOfData part = part_of_data(frf, weighed(frf), model);
  EXPECT_FALSE(part.all);
  ASSERT_EQ(part.frf.lines(), 550);
  ASSERT_EQ(part.frf.n_inputs(), 11);
  ASSERT_EQ(part.frf.n_outputs(), 11);
  for (Eigen::Index u = 0; u < 11; ++u) {
    EXPECT_EQ(part.frf.inputs.names[static_cast<std::size_t>(u)], fmt::format("u{}", 30 * u));
    EXPECT_EQ(part.model.input_delay_s[u], model.input_delay_s[30 * u]);
    for (Eigen::Index y = 0; y < 11; ++y) {
      const Eigen::Index of_all = y * 40 / 11;
      EXPECT_EQ(part.frf.outputs.names[static_cast<std::size_t>(y)], fmt::format("y{}", of_all));
      EXPECT_EQ(part.model.output_delay_s[y], model.output_delay_s[of_all]);
      const std::complex<double> response = frf.response(1200 * u + of_all, 14);
      EXPECT_EQ(part.frf.response(11 * u + y, 7), response);
      EXPECT_EQ((*part.options.user_weights)(11 * u + y, 7), std::norm(response));
      EXPECT_EQ(part.model.submodels[0].numerator[0](y, u),
                model.submodels[0].numerator[0](of_all, 30 * u));
    }
  }
  EXPECT_EQ(part.frf.frequency_hz[7], frf.frequency_hz[14]);
  EXPECT_EQ(part.frf.correlated_lines, 3.0);

  const AdditiveModel whole = with_all_channels(frf, part.model);
  EXPECT_EQ(whole.inputs.names, frf.inputs.names);
  EXPECT_EQ(whole.outputs.names, frf.outputs.names);
  EXPECT_EQ(whole.submodels[0].denominator, model.submodels[0].denominator);
  EXPECT_TRUE(whole.submodels[0].numerator[0].isZero(0.0));
  ASSERT_EQ(whole.input_delay_s.size(), 330);
  ASSERT_EQ(whole.output_delay_s.size(), 40);
  EXPECT_NEAR(whole.mean_delay_s(), part.model.mean_delay_s(), 1e-15);
}

TEST(PartOfData, FewInputsLeaveMoreOutputs) {
  const FrfEstimate frf = frf_of(300, 2, 100);
  const PartOfData part = part_of_data(frf, weighed(frf), one_mode(frf));
  EXPECT_EQ(part.frf.n_inputs(), 2);
  EXPECT_EQ(part.frf.n_outputs(), 64);
}

TEST(PartOfData, OfChannelsHasAllLinesAndTheVariances) {
  FrfEstimate frf = frf_of(300, 2, 1100);
  frf.noise_variance = frf.response.cwiseAbs();
  frf.total_variance = 2.0 * frf.noise_variance;
  frf.noise_dof = 8.0;
  frf.total_dof = 3.0;
  const PartOfData part = part_of_channels(frf, weighed(frf), one_mode(frf));
  EXPECT_FALSE(part.all);
  EXPECT_EQ(part.frf.response.rows(), 128);
  EXPECT_EQ(part.frf.frequency_hz, frf.frequency_hz);
  EXPECT_EQ(part.frf.noise_variance, Eigen::MatrixXd(part.frf.response.cwiseAbs()));
  EXPECT_EQ(part.frf.total_variance, 2.0 * part.frf.noise_variance);
  EXPECT_EQ(part.frf.noise_dof, 8.0);
  EXPECT_EQ(part.frf.total_dof, 3.0);
}

TEST(PartOfData, ManyModesNeedManyLines) {
  const FrfEstimate frf = frf_of(1, 1, 4000);
  AdditiveModel model = one_mode(frf);
  EXPECT_EQ(part_of_data(frf, weighed(frf), model).frf.lines(), 500);
  model.submodels.resize(100, model.submodels[0]);
  EXPECT_EQ(part_of_data(frf, weighed(frf), model).frf.lines(), 2000);
}

}  // namespace stageid::part_of_data_test
