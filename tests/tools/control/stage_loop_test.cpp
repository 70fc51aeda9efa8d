#include "tools/control/stage_loop.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "hal/stage/motion_controller.hpp"
#include "tests/support/process/error_message.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid::test_stage_loop {

using testing::ElementsAre;
using testing::HasSubstr;

StageSpec wafer_stage() {
  return load_stage_config(std::filesystem::path(STAGEID_SOURCE_DIR) /
                           "configs/stage/wafer_stage.yaml")
      .spec;
}

/// A model with the channels of the stage whose names begin so, in reverse order.
AdditiveModel model_of(const StageSpec& stage, const std::string& sensors,
                       const std::string& actuators) {
  AdditiveModel model;
  model.sample_rate_hz = stage.info.sample_rate_hz;
  const auto take = [](const std::vector<Channel>& channels, const std::string& start,
                       ChannelList& list) {
    for (const Channel& channel : channels)
      if (channel.name.rfind(start, 0) == 0) list.names.insert(list.names.begin(), channel.name);
    list.units.assign(list.names.size(), "m");
  };
  take(stage.info.sensors, sensors, model.outputs);
  take(stage.info.actuators, actuators, model.inputs);
  return model;
}

/// T K is the controller of the stage between the channels of the model.
void expect_response(const StageSpec& stage, const AdditiveModel& model,
                     const LoopController& loop) {
  const MotionController controller(stage.controller);
  const auto place = [](const std::vector<Channel>& channels, const std::string& name) {
    return std::ranges::find(channels, name, &Channel::name) - channels.begin();
  };
  for (const double hz : {3.0, 40.0, 900.0}) {
    const Eigen::MatrixXcd told = loop.actuators.cast<std::complex<double>>() *
                                  controller_response(loop, hz, model.sample_rate_hz);
    const Eigen::MatrixXcd exact = -controller.response(hz);
    ASSERT_EQ(told.rows(), model.n_inputs());
    for (Eigen::Index j = 0; j < told.rows(); ++j)
      for (Eigen::Index i = 0; i < told.cols(); ++i)
        EXPECT_LT(std::abs(told(j, i) - exact(place(stage.info.actuators, model.inputs.name(j)),
                                              place(stage.info.sensors, model.outputs.name(i)))),
                  1e-9 * exact.norm());
  }
}

TEST(StageLoop, HasTheAxesOfTheModel) {
  const StageSpec stage = wafer_stage();
  const AdditiveModel vertical = model_of(stage, "sz", "z");
  const LoopController loop = stage_loop(stage, vertical);
  EXPECT_THAT(loop.loops, ElementsAre("z", "Rx", "Ry"));
  expect_response(stage, vertical, loop);
  EXPECT_THAT(stage_loop(stage, model_of(stage, "s", "z")).loops, ElementsAre("z", "Rx", "Ry"));
  const AdditiveModel whole = model_of(stage, "", "");
  const LoopController all = stage_loop(stage, whole);
  EXPECT_THAT(all.loops, ElementsAre("x", "y", "z", "Rx", "Ry", "Rz"));
  expect_response(stage, whole, all);
}

TEST(StageLoop, RefusesAModelWithoutSomeOfItsChannels) {
  const StageSpec stage = wafer_stage();
  AdditiveModel model = model_of(stage, "sz", "z");
  model.inputs.names[0] = "other";
  EXPECT_THAT(test::error_message<std::invalid_argument>([&] { stage_loop(stage, model); }),
              HasSubstr("the loop of z uses actuator 'z13', which is not an input of the model"));
  EXPECT_THAT(test::error_message<std::invalid_argument>(
                  [&] { stage_loop(stage, model_of(stage, "sx", "z")); }),
              HasSubstr("closes no loop between channels of the model"));
  StageSpec peer = stage;
  peer.controller.by_peer = true;
  EXPECT_THAT(test::error_message<std::invalid_argument>(
                  [&] { stage_loop(peer, model_of(stage, "sz", "z")); }),
              HasSubstr("'controller: peer'"));
}

TEST(StageLoop, OfMatricesIsOneLoopPerActuatorThatTheyDrive) {
  StageSpec stage = wafer_stage();
  const auto n_u = std::ssize(stage.info.actuators);
  const auto n_y = std::ssize(stage.info.sensors);
  stage.controller.axes.clear();
  stage.controller.sensor_decoupling.resize(0, n_y);
  stage.controller.actuator_decoupling.resize(n_u, 0);
  ControllerStateSpace& s = stage.controller.state_space;
  s.a = Eigen::MatrixXd{{0.9, 0.1}, {0.0, 0.5}};
  s.b = Eigen::MatrixXd::Zero(2, n_y);
  s.b(0, 1) = 2.0;
  s.b(1, 2) = 3.0;
  s.c = Eigen::MatrixXd::Zero(n_u, 2);
  s.c(3, 0) = 5.0;
  s.c(7, 1) = -4.0;
  s.d = Eigen::MatrixXd::Zero(n_u, n_y);
  s.d(3, 0) = 7.0;
  const AdditiveModel model = model_of(stage, "sz", "z");
  const LoopController loop = stage_loop(stage, model);
  EXPECT_THAT(loop.loops, ElementsAre("z4", "z8"));
  expect_response(stage, model, loop);
}

}  // namespace stageid::test_stage_loop
