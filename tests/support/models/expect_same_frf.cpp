#include "tests/support/models/expect_same_frf.hpp"

#include <gtest/gtest.h>

namespace stageid::test {

void expect_same(const FrfEstimate& a, const FrfEstimate& b) {
  const auto same = [](const char* what, const auto& x, const auto& y) {
    EXPECT_TRUE(x.rows() == y.rows() && x.cols() == y.cols() && x == y) << what;
  };
  same("frequency_hz", a.frequency_hz, b.frequency_hz);
  same("response", a.response, b.response);
  same("noise_variance", a.noise_variance, b.noise_variance);
  same("total_variance", a.total_variance, b.total_variance);
  same("covariance", a.covariance, b.covariance);
  same("residual_covariance", a.residual_covariance, b.residual_covariance);
  same("input_factor", a.input_factor, b.input_factor);
  same("input_condition", a.input_condition, b.input_condition);
  same("interpolation_misfit", a.interpolation_misfit, b.interpolation_misfit);
  same("excluded_power", a.excluded_power, b.excluded_power);
  same("detection frequency_hz", a.detection.frequency_hz, b.detection.frequency_hz);
  same("detection line", a.detection.line, b.detection.line);
  same("detection runs", a.detection.runs, b.detection.runs);
  same("detection power", a.detection.power, b.detection.power);
  same("detection noise", a.detection.noise, b.detection.noise);
  same("detection linear_power", a.detection.linear_power, b.detection.linear_power);
  same("band_hz", a.nonlinearity.band_hz, b.nonlinearity.band_hz);
  same("p_value", a.nonlinearity.p_value, b.nonlinearity.p_value);
  same("distortion", a.nonlinearity.distortion, b.nonlinearity.distortion);
  same("settled_p_value", a.nonlinearity.settled_p_value, b.nonlinearity.settled_p_value);
  same("even p_value", a.nonlinearity.even.p_value, b.nonlinearity.even.p_value);
  same("even level", a.nonlinearity.even.level, b.nonlinearity.even.level);
  same("odd p_value", a.nonlinearity.odd.p_value, b.nonlinearity.odd.p_value);
  same("odd level", a.nonlinearity.odd.level, b.nonlinearity.odd.level);
  EXPECT_EQ(a.detection.groups, b.detection.groups);
  EXPECT_EQ(a.detection.noise_dof, b.detection.noise_dof);
  EXPECT_EQ(a.inputs, b.inputs);
  EXPECT_EQ(a.outputs, b.outputs);
  EXPECT_EQ(a.sample_rate_hz, b.sample_rate_hz);
  EXPECT_EQ(a.hold, b.hold);
  EXPECT_EQ(a.compensated, b.compensated);
  EXPECT_EQ(a.delay_s, b.delay_s);
  EXPECT_EQ(a.method, b.method);
  EXPECT_EQ(a.realizations, b.realizations);
  EXPECT_EQ(a.periods, b.periods);
  EXPECT_EQ(a.experiments, b.experiments);
  EXPECT_EQ(a.noise_dof, b.noise_dof);
  EXPECT_EQ(a.total_dof, b.total_dof);
  EXPECT_EQ(a.covariance_lines, b.covariance_lines);
  EXPECT_EQ(a.correlated_lines, b.correlated_lines);
  EXPECT_EQ(a.experiment_noise_ratio, b.experiment_noise_ratio);
  EXPECT_EQ(a.dropped_periods, b.dropped_periods);
  EXPECT_EQ(a.replaced_samples, b.replaced_samples);
  EXPECT_EQ(a.left_out_realizations, b.left_out_realizations);
  EXPECT_EQ(a.excluded_channels, b.excluded_channels);
  EXPECT_EQ(a.provenance_json, b.provenance_json);
}

void expect_same(const RealizationRecord& a, const RealizationRecord& b) {
  EXPECT_EQ(a.realization, b.realization);
  EXPECT_EQ(a.periods, b.periods);
  EXPECT_EQ(a.frequency_hz, b.frequency_hz);
  EXPECT_EQ(a.axes, b.axes);
  ASSERT_EQ(a.lines.size(), b.lines.size());
  for (std::size_t k = 0; k < a.lines.size(); ++k) {
    EXPECT_EQ(a.lines[k].R, b.lines[k].R);
    EXPECT_EQ(a.lines[k].Z, b.lines[k].Z);
  }
}

}  // namespace stageid::test
