#include "frf/response/channel_tiles.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <functional>

#include "frf/file/frf_file.hpp"
#include "frf/response/distortion_variance.hpp"
#include "frf/response/hold_compensation.hpp"
#include "frf/response/neighbour_scatter.hpp"
#include "frf/response/responding_channels.hpp"
#include "tests/support/models/divided_frf.hpp"
#include "tests/support/process/random_numbers.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/process/thread_team.hpp"

namespace stageid::test_channel_tiles {

using test::divided;
using test::run_team;

/// 660 channels: three tiles, of which an input ends within the second.
FrfEstimate wide_frf() {
  FrfEstimate frf;
  for (int y = 0; y < 330; ++y) frf.outputs.names.push_back(fmt::format("y{}", y));
  frf.inputs.names = {"u0", "u1"};
  frf.outputs.units.assign(330, "m");
  frf.inputs.units.assign(2, "N");
  frf.frequency_hz = Eigen::VectorXd::LinSpaced(40, 1.0, 40.0);
  frf.sample_rate_hz = 100.0;
  frf.hold = Hold::zoh;
  frf.realizations = 3;
  frf.total_dof = 2.0;
  frf.noise_dof = 12.0;
  test::RandomNumbers random(4);
  frf.response = circular_matrix(random, 660, 40);
  frf.noise_variance = circular_matrix(random, 660, 40).cwiseAbs2();
  frf.total_variance = 2.0 * circular_matrix(random, 660, 40).cwiseAbs2();
  return frf;
}

template <typename Matrix>
void expect_own_rows(const Matrix& some, const Matrix& all, DataRange own) {
  ASSERT_EQ(some.rows(), all.rows());
  ASSERT_EQ(some.cols(), all.cols());
  EXPECT_TRUE(some.matrix().middleRows(own.first, own.count) ==
              all.matrix().middleRows(own.first, own.count));
}

/// Calls test(frf) with what every process of teams has; of four, one has nothing.
void for_each_share(const FrfEstimate& whole, const std::function<void(const FrfEstimate&)>& test) {
  for (const int size : {2, 3, 4})
    run_team(size, [&](const Team& team) { test(divided(whole, team)); });
}

TEST(ChannelTiles, VariancesAndLinearityNeedOnlyTheRowsOfAProcess) {
  const FrfEstimate whole = wide_frf();
  const DistortionVariance distorted = distortion_variance(whole);
  const NonlinearityTest linearity = nonlinearity_test(whole);
  const LineScatter scatter = line_scatter(whole, 1);
  const bool coarse = lines_are_coarse(whole, scatter, 1);
  const ChannelFlags responding = responding_channels(whole);
  for_each_share(whole, [&](const FrfEstimate& frf) {
    const DistortionVariance own = distortion_variance(frf);
    expect_own_rows(own.variance, distorted.variance, frf.own());
    EXPECT_TRUE(own.distortion.level == distorted.distortion.level);
    EXPECT_TRUE(nonlinearity_test(frf).p_value == linearity.p_value);
    EXPECT_TRUE(nonlinearity_test(frf).distortion == linearity.distortion);
    const LineScatter own_scatter = line_scatter(frf, 1);
    expect_own_rows(own_scatter.variance, scatter.variance, frf.own());
    EXPECT_EQ(own_scatter.over_noise, scatter.over_noise);
    EXPECT_EQ(lines_are_coarse(frf, own_scatter, 1), coarse);
    expect_own_rows(responding_channels(frf), responding, frf.own());
  });
}

TEST(ChannelTiles, ABandAndARestoredDelayKeepTheRowsOfAProcess) {
  FrfEstimate whole = compensate(wide_frf(), Compensation::delay, 1e-3);
  const FrfEstimate expected = as_measured(select_band(whole, 5.0, 30.0));
  for_each_share(whole, [&](const FrfEstimate& frf) {
    const FrfEstimate own = as_measured(select_band(frf, 5.0, 30.0));
    check(own);
    expect_own_rows(own.response, expected.response, own.own());
    expect_own_rows(own.noise_variance, expected.noise_variance, own.own());
    const FrfEstimate copy = own;  // NOLINT(performance-unnecessary-copy-initialization): examined
    expect_own_rows(copy.total_variance, expected.total_variance, copy.own());
  });
}

TEST(ChannelTiles, ChosenChannelsReachEveryProcess) {
  const FrfEstimate whole = wide_frf();
  const std::vector<Eigen::Index> chosen{0, 255, 256, 300, 659};
  const Eigen::MatrixXcd expected = whole.response(chosen, Eigen::seqN(0, 20, 2));
  for_each_share(whole, [&](const FrfEstimate& frf) {
    EXPECT_TRUE(chosen_channels(*frf.team, frf.response, chosen, Eigen::seqN(0, 20, 2)) ==
                expected);
  });
}

TEST(ChannelTiles, AProcessReadsItsRowsOfTheFile) {
  const test::TemporaryDirectory folder;
  write_frf(folder / "frf.h5", wide_frf());
  const FrfEstimate whole = read_frf(folder / "frf.h5");
  for (const int size : {1, 2, 3, 4})
    for (int rank = 0; rank < size; ++rank) {
      test::Mailboxes none;
      const test::ThreadTeam team(rank, size, none);
      const FrfEstimate own = read_frf(folder / "frf.h5", &team);
      EXPECT_TRUE(own.frequency_hz == whole.frequency_hz);
      expect_own_rows(own.response, whole.response, own.own());
      expect_own_rows(own.noise_variance, whole.noise_variance, own.own());
      expect_own_rows(own.total_variance, whole.total_variance, own.own());
    }
}

TEST(ChannelTiles, CorrelatedOutputsNeedAllRows) {
  const test::TemporaryDirectory folder;
  FrfEstimate frf = wide_frf();
  frf.frequency_hz.conservativeResize(2);
  for (Eigen::MatrixXd* const variance : {&frf.noise_variance, &frf.total_variance})
    variance->conservativeResize(Eigen::NoChange, 2);
  frf.response.conservativeResize(Eigen::NoChange, 2);
  frf.residual_covariance.setOnes(330 * 330, 2);
  write_frf(folder / "frf.h5", frf);
  test::Mailboxes none;
  const test::ThreadTeam team(1, 2, none);
  EXPECT_TRUE(read_frf(folder / "frf.h5", &team).response == frf.response);
}

}  // namespace stageid::test_channel_tiles
