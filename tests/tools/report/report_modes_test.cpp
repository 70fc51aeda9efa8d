#include "tools/report/report_modes.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace stageid {
namespace test_report_modes {

Submodel mode(double frequency_hz, double damping = 0.01, std::optional<double> std_hz = {}) {
  const double omega = 2.0 * std::numbers::pi * frequency_hz;
  Submodel out;
  out.denominator = {1.0, 2.0 * damping / omega, 1.0 / (omega * omega)};
  out.natural_frequency_std_hz = std_hz;
  if (std_hz) out.damping_ratio_std = 0.01 * damping;
  return out;
}

AdditiveModel model_of(std::vector<Submodel> submodels) {
  AdditiveModel model;
  model.submodels = std::move(submodels);
  return model;
}

TrueMode truth(double frequency_hz, double damping = 0.01) {
  return {.natural_frequency_hz = frequency_hz, .damping_ratio = damping};
}

TEST(ModeTable, BothModesOfAClosePairGetTheirPartner) {
  // 200.4 is within the limit of both true modes.
  const auto rows =
      mode_table(model_of({mode(200.9), mode(200.4)}), std::vector{truth(201.0), truth(200.0)});
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_NEAR(*rows[0].frequency_hz, 200.4, 1e-9);
  EXPECT_EQ(rows[0].truth->natural_frequency_hz, 200.0);
  EXPECT_NEAR(*rows[1].frequency_hz, 200.9, 1e-9);
  EXPECT_EQ(rows[1].truth->natural_frequency_hz, 201.0);
}

TEST(ModeTable, AMissingModeDoesNotShiftTheOthers) {
  const auto rows = mode_table(model_of({mode(100.0), mode(201.5), mode(300.0)}),
                               std::vector{truth(100.0), truth(200.0), truth(201.4), truth(300.0)});
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_FALSE(rows[1].frequency_hz);
  EXPECT_EQ(rows[1].truth->natural_frequency_hz, 200.0);
  EXPECT_NEAR(*rows[2].frequency_hz, 201.5, 1e-9);
  EXPECT_EQ(rows[2].truth->natural_frequency_hz, 201.4);
  EXPECT_EQ(rows[3].truth->natural_frequency_hz, 300.0);
}

TEST(ModeTable, AModeFarFromAllHasNoTruth) {
  const auto rows = mode_table(model_of({mode(100.0), mode(150.0)}), std::vector{truth(100.0)});
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_TRUE(rows[0].truth);
  EXPECT_FALSE(rows[1].truth);
  EXPECT_FALSE(rows[1].frequency_deviation());
}

TEST(ModeTable, OnlyModesAreListedByFrequency) {
  Submodel rigid;
  rigid.integrators = 2;
  const auto rows = mode_table(model_of({mode(300.0), rigid, mode(100.0)}), {});
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_NEAR(*rows[0].frequency_hz, 100.0, 1e-9);
  EXPECT_NEAR(*rows[1].frequency_hz, 300.0, 1e-9);
}

TEST(ModeTable, DeviationsAreSignedAndInStandardDeviations) {
  const auto rows =
      mode_table(model_of({mode(99.0, 0.0102, 0.5)}), std::vector{truth(100.0, 0.01)});
  ASSERT_EQ(rows.size(), 1u);
  EXPECT_NEAR(*rows[0].frequency_deviation(), -2.0, 1e-9);
  EXPECT_NEAR(*rows[0].damping_deviation(), 0.0002 / 0.000102, 1e-9);
  EXPECT_NEAR(*rows[0].relative_frequency_error(), 0.01, 1e-9);
}

TEST(ModeTable, WithoutStandardDeviationNothingIsInStandardDeviations) {
  const auto rows = mode_table(model_of({mode(99.0)}), std::vector{truth(100.0)});
  EXPECT_FALSE(rows[0].frequency_deviation());
  EXPECT_FALSE(rows[0].damping_deviation());
}

}  // namespace test_report_modes
}  // namespace stageid
