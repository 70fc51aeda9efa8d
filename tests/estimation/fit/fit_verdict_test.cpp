#include "estimation/fit/fit_verdict.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace stageid::test_late_channels {

using testing::HasSubstr;

AdditiveModel with_delays(const Eigen::VectorXd& inputs_s, const Eigen::VectorXd& outputs_s) {
  AdditiveModel model;
  model.inputs.names = {"a1", "a2", "a3", "a4"};
  model.inputs.names.resize(static_cast<std::size_t>(inputs_s.size()));
  model.outputs.names = {"z1", "z2", "z3"};
  model.outputs.names.resize(static_cast<std::size_t>(outputs_s.size()));
  model.sample_rate_hz = 1000.0;
  model.input_delay_s = inputs_s;
  model.output_delay_s = outputs_s;
  model.input_delay_std_s.setConstant(inputs_s.size(), 1e-6);
  model.output_delay_std_s.setConstant(outputs_s.size(), 1e-6);
  return model;
}

TEST(LateChannels, AreNamedIfTheyDifferByMoreThanTheirDeviations) {
  EXPECT_THAT(late_channels(with_delays(Eigen::Vector4d(2e-3, 2e-3, 1.5e-3, 2e-3),
                                        Eigen::Vector3d(0.0, 1e-3, 0.0))),
              HasSubstr("z2 +1, a3 -0.5 samples relative"));
  EXPECT_EQ(late_channels(
                with_delays(Eigen::Vector3d(2e-3, 2.004e-3, 1.997e-3), Eigen::Vector2d(0.0, 3e-6))),
            "");
  const std::string of_two =
      late_channels(with_delays(Eigen::Vector2d(3e-3, 2e-3), Eigen::VectorXd::Zero(1)));
  EXPECT_THAT(of_two, HasSubstr("a1 +1 samples"));
  EXPECT_THAT(of_two, testing::Not(HasSubstr("a2")));
}

TEST(DoubtfulDelay, IsUnknownByMoreThanASample) {
  const auto findings = [](DelayModel delay, double deviation_s) {
    FitResult fit;
    fit.delay = delay;
    fit.model = with_delays(Eigen::Vector2d(3e-3, 3e-3), Eigen::VectorXd::Zero(1));
    fit.model.input_delay_std_s[1] = deviation_s;
    judge({}, {}, fit);
    return fit.findings;
  };
  EXPECT_THAT(findings(DelayModel::estimate, 1.1e-3),
              testing::ElementsAre(HasSubstr("the data do not determine the delay: the standard "
                                             "deviation is 1.1e+03 us")));
  EXPECT_THAT(findings(DelayModel::per_channel, 1.1e-3),
              testing::ElementsAre(HasSubstr("the delays of the channels")));
  EXPECT_THAT(findings(DelayModel::estimate, 0.9e-3), testing::IsEmpty());
  EXPECT_THAT(findings(DelayModel::fixed, 1.1e-3), testing::IsEmpty());
}

}  // namespace stageid::test_late_channels
