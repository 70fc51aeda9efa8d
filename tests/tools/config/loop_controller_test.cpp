// Controllers of a stage file in every form: axes, matrices, transfer functions, files, the stage itself.
#include "tools/config/loop_controller.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/input_files.hpp"
#include "hal/simulator/loop_stability.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/tools/config/controller_arrays.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/config/stage_expectation.hpp"
#include "tools/exchange/matlab/mat_file.hpp"

namespace stageid::test_loop_controller {

using testing::HasSubstr;

const std::filesystem::path kSmall =
    std::filesystem::path(STAGEID_SOURCE_DIR) / "configs/stage/small_stage.yaml";

std::string row_by_row(const Eigen::MatrixXd& m) {
  const auto values = m.reshaped<Eigen::RowMajor>();
  return fmt::format("[{:.17g}]", fmt::join(values.begin(), values.end(), ", "));
}

struct LoopController : testing::Test {
  LoopController()
      : axes_(load_stage_config(kSmall).spec),
        controller_(axes_.controller),
        system_(controller_.realization()) {
    const std::string text = read_whole_file(kSmall);
    head_ = text.substr(0, text.find("controller:"));
  }

  StageConfig stage(const std::string& controller) const {
    std::ofstream(directory_ / "stage.yaml") << head_ << controller << "\n";
    return load_stage_config(directory_ / "stage.yaml");
  }
  std::string error_of(const std::string& controller) const {
    return test::error_message<FormatError>([&] { stage(controller); });
  }
  std::string matrices() const {
    return fmt::format("state_space: {{a: {}, b: {}, c: {}, d: {}}}", row_by_row(system_.a),
                       row_by_row(system_.b), row_by_row(system_.c), row_by_row(system_.d));
  }
  std::string controller_file(double rate_hz = 2000.0) const {
    return fmt::format(
        "format: stageid-controller\nsensors: [s1, s2]\nactuators: [a1, a2, a3]\n"
        "sample_rate_hz: {}\n{}\n",
        rate_hz, matrices());
  }
  ArrayList arrays(const std::string& file) const {
    return test::arrays_of(directory_ / file, system_);
  }
  void expect_same(const StageConfig& config, const std::string& form) const {
    const MotionController controller(config.spec.controller);
    for (const double hz : {0.5, 20.0, 150.0, 900.0}) {
      const Eigen::MatrixXcd exact = controller_.response(hz);
      EXPECT_LT((controller.response(hz) - exact).norm(), 1e-9 * exact.norm()) << form << hz;
    }
    const LoopStability loop = loop_stability(config.spec, config.plant.value());
    EXPECT_TRUE(loop.tested && loop.stable()) << form;
    EXPECT_GT(config.spec.limits.motion.bandwidth_rad_s, 0.0) << form;
    // The health checks of a log know the same controller.
    const NominalStage nominal = nominal_stage(config.spec, config.plant);
    EXPECT_LT((nominal.controller(20.0) - controller_.response(20.0)).norm(),
              1e-9 * controller_.response(20.0).norm())
        << form;
  }

  test::TemporaryDirectory directory_;
  StageSpec axes_;
  MotionController controller_;
  ControllerStateSpace system_;
  std::string head_;
};

TEST_F(LoopController, EveryFormIsTheSameController) {
  expect_same(stage("controller:\n  " + matrices()), "in the stage file");
  std::ofstream(directory_ / "c.yaml") << controller_file();
  expect_same(stage("controller: c.yaml"), "yaml");
  write_npz(directory_ / "c.npz", arrays("c.npz"));
  expect_same(stage("controller: c.npz"), "npz");
  write_mat(directory_ / "c.mat", arrays("c.mat"));
  expect_same(stage("controller: c.mat"), "mat");
  write_hdf5_arrays(directory_ / "c.h5", arrays("c.h5"));
  expect_same(stage("controller: c.h5"), "h5");
  std::ofstream table(directory_ / "c.csv");
  Eigen::MatrixXd packed(system_.a.rows() + 3, system_.a.rows() + 2);
  packed << system_.a, system_.b, system_.c, system_.d;
  for (const auto& row : packed.rowwise()) {
    const std::string text = row_by_row(row);
    table << text.substr(1, text.size() - 2) << "\n";
  }
  table.close();
  expect_same(stage("controller: c.csv"), "csv");
}

TEST_F(LoopController, AJsonFileIsAControllerFile) {
  std::ofstream(directory_ / "c.json")
      << R"({"format": "stageid-controller", "sensors": ["s2"], "actuators": ["a3", "a1"],
             "sample_rate_hz": 2000, "state_space": {"a": [0.5], "b": [1], "c": [2, 3]}})";
  const MotionController controller(stage("controller: c.json").spec.controller);
  const std::complex<double> z = std::polar(1.0, 2.0 * std::numbers::pi * 100.0 / 2000.0);
  const Eigen::MatrixXcd response = controller.response(100.0);
  EXPECT_LT(std::abs(response(2, 1) + 2.0 / (z - 0.5)), 1e-12);
  EXPECT_LT(std::abs(response(0, 1) + 3.0 / (z - 0.5)), 1e-12);
  EXPECT_EQ(response.row(1).norm() + response.col(0).norm(), 0.0);
}

TEST_F(LoopController, TransferFunctionsAreFilters) {
  const StageConfig config = stage(
      "controller:\n  transfer:\n"
      "    - {actuator: a2, sensor: s1, numerator: [5000, -4900], denominator: [1, -0.5]}\n");
  const std::complex<double> z = std::polar(1.0, 2.0 * std::numbers::pi * 100.0 / 2000.0);
  const Eigen::MatrixXcd response = MotionController(config.spec.controller).response(100.0);
  EXPECT_LT(std::abs(response(1, 0) + (5000.0 * z - 4900.0) / (z - 0.5)), 1e-9 * 5000.0);
  EXPECT_NEAR(response.norm(), std::abs(response(1, 0)), 1e-12);
}

TEST_F(LoopController, TheLogKeepsAControllerInAnotherFile) {
  write_npz(directory_ / "c.npz", arrays("c.npz"));
  const StageConfig config = stage("controller: c.npz");
  std::filesystem::remove(directory_ / "c.npz");
  expect_same(parse_stage_config("log", config.text, config.controller_text), "log");
  EXPECT_THROW(parse_stage_config("log", config.text, ""), FormatError);
}

TEST_F(LoopController, RefusesWhatCannotBeComputedSampleBySample) {
  std::ofstream(directory_ / "other_rate.yaml") << controller_file(1000.0);
  EXPECT_THAT(error_of("controller: other_rate.yaml"),
              HasSubstr("the controller is discrete at 1000 Hz, the stage runs at 2000 Hz"));
  std::ofstream(directory_ / "continuous.yaml")
      << "format: stageid-controller\nsensors: [s1]\nactuators: [a1]\ntime: continuous\n"
         "transfer: [{actuator: a1, sensor: s1, numerator: [1], denominator: [1, 1]}]\n";
  EXPECT_THAT(error_of("controller: continuous.yaml"), HasSubstr("Write a discrete state_space"));
  std::ofstream(directory_ / "foreign.yaml")
      << "format: stageid-controller\nsensors: [s9]\nactuators: [a1]\nsample_rate_hz: 2000\n"
         "state_space: {d: [1]}\n";
  EXPECT_THAT(error_of("controller: foreign.yaml"), HasSubstr("no channel 's9'"));
  EXPECT_THAT(error_of("controller: missing.mat"), HasSubstr("missing.mat"));
  EXPECT_THAT(error_of("controller:\n  transfer: [{actuator: a1, sensor: s1, numerator: [1, 0, 0], "
                       "denominator: [1, 1]}]"),
              HasSubstr("causal"));
  ArrayList transposed = arrays("t.npz");
  transposed.arrays[1] = test::array_of("B", system_.b.transpose());
  write_npz(directory_ / "t.npz", transposed);
  EXPECT_THAT(error_of("controller: t.npz"), HasSubstr("expected 8 x 2"));
}

TEST_F(LoopController, OfAPeerNothingIsKnown) {
  const StageConfig config = stage("controller: peer");
  EXPECT_TRUE(config.spec.controller.by_peer);
  EXPECT_FALSE(loop_stability(config.spec, config.plant.value()).tested);
  const NominalStage nominal = nominal_stage(config.spec, config.plant);
  EXPECT_FALSE(nominal.controller);
  EXPECT_TRUE(nominal.rigid_body);
}

// A real back end needs no plant; the simulator does.
TEST_F(LoopController, OnlyASimulatedStageNeedsAPlant) {
  const std::string plant =
      head_.substr(head_.find("plant:"), head_.find("noise:") - head_.find("plant:"));
  head_.erase(head_.find("plant:"), plant.size());
  EXPECT_THAT(error_of("controller:\n  " + matrices()), HasSubstr("key 'plant' is missing"));
  head_.replace(head_.find("backend: sim"), 12, "backend: plugin\nplugin: {library: ./stage.so}");
  const StageConfig config = stage("controller:\n  " + matrices());
  EXPECT_FALSE(config.plant.has_value());
  EXPECT_EQ(config.spec.limits.motion.acceleration_per_n.size(), 0);  // unknown inertia
  EXPECT_FALSE(nominal_stage(config.spec, config.plant).rigid_body);
  const StageConfig axes = stage(
      "controller:\n  z: {crossover_hz: 20, gain: 1e5, lead_zero_hz: 6, "
      "lead_pole_hz: 80}");
  EXPECT_GT(axes.spec.limits.motion.acceleration_per_n.norm(), 0.0);  // from the gain
  EXPECT_THAT(error_of("controller:\n  z: {crossover_hz: 20}"), HasSubstr("gain"));
}

TEST_F(LoopController, ABiasIsAFeedForwardWithinItsLimit) {
  head_.replace(head_.find("limit_n: 40"), 11, "limit_n: 40, bias_n: -12");
  const StageConfig config = stage("controller:\n  " + matrices());
  EXPECT_EQ(config.spec.controller.feed_forward_n, Eigen::Vector3d(-12.0, 0.0, 0.0));
  head_.replace(head_.find("bias_n: -12"), 11, "bias_n: -41");
  EXPECT_THAT(error_of("controller:\n  " + matrices()), HasSubstr("bias_n: -41 N exceeds limit_n"));
}

}  // namespace stageid::test_loop_controller
