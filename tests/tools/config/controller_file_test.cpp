// A controller that is not in the form of a stage file: matrices, transfer functions, a measured response.
#include "tools/config/controller_file.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <fstream>
#include <numbers>

#include "acquisition/files/file_error.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/health/data_health.hpp"
#include "tests/support/process/error_message.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/closed_loop.hpp"
#include "tools/config/stage_expectation.hpp"

namespace stageid::test_controller_file {

using test::MemoryLog;
using testing::AllOf;
using testing::HasSubstr;

/// test::small_stage()'s controller, 0.3 (1 + s/60) / (1 + s/900) times a matrix.
constexpr double kGain[3][2] = {{0.8, -0.3}, {0.1, 0.9}, {0.4, 0.5}};

std::string head(const std::string& more) {
  return "format: stageid-controller\nsensors: [z1, z2]\nactuators: [a1, a2, a3]\n" + more;
}

std::string transfer_text() {
  std::string text = head("time: continuous\ntransfer:\n");
  for (int u = 0; u < 3; ++u)
    for (int y = 0; y < 2; ++y)
      text += fmt::format(
          "  - {{actuator: a{}, sensor: z{}, numerator: [{:.17g}, {:.17g}], denominator: [{:.17g}, "
          "1]}}\n",
          u + 1, y + 1, 0.3 * kGain[u][y] / 60.0, 0.3 * kGain[u][y], 1.0 / 900.0);
  return text;
}

/// One state a sensor: 0.3 (15 - 14 * 900 / (s + 900)).
std::string state_space_text() {
  std::string c;
  std::string d;
  for (const auto& row : kGain)
    for (const double g : row) {
      c += fmt::format("{}{:.17g}", c.empty() ? "" : ", ", -0.3 * 14.0 * 900.0 * g);
      d += fmt::format("{}{:.17g}", d.empty() ? "" : ", ", 0.3 * 15.0 * g);
    }
  return head("time: continuous\nstate_space:\n  a: [-900, 0, 0, -900]\n  b: [1, 0, 0, 1]\n  c: [" +
              c + "]\n  d: [" + d + "]\n");
}

struct ControllerFileTest : testing::Test {
  std::filesystem::path write(const std::string& text) const {
    const std::filesystem::path file = directory_ / "controller.yaml";
    std::ofstream(file) << text;
    return file;
  }
  std::string error_of(const std::string& text) const {
    return test::error_message<FormatError>(
        [&] { read_controller_file(YamlDocument::parse("c.yaml", text)); });
  }
  void write_measured() const {
    FrfEstimate frf;
    frf.inputs = test::channels("z", 2, "m");
    frf.outputs = test::channels("a", 3, "N");
    frf.frequency_hz = Eigen::VectorXd::LinSpaced(250, 2.0, 500.0);
    frf.response.resize(6, 250);
    for (Eigen::Index k = 0; k < 250; ++k)
      frf.response.col(k) =
          test::small_stage().controller(2.0 * std::numbers::pi * frf.frequency_hz[k]).reshaped();
    write_frf(directory_ / "c.h5", frf);
  }

  test::TemporaryDirectory directory_;
};

MemoryLog small_log() {
  test::LoopExperiment x{.periods = 3};
  x.lines.clear();
  for (int line = 1; line < 100; line += 2) x.lines.push_back(line);
  x.noise_factor = 1e-3 * Eigen::MatrixXcd::Identity(2, 2);
  return test::simulate_log(test::small_stage(), x);
}

TEST_F(ControllerFileTest, EveryFormGivesTheSameResponse) {
  write_measured();
  const LogInfo info = small_log().log_info;
  for (const std::string& text : {transfer_text(), state_space_text(),
                                  std::string("format: stageid-controller\nmeasured: c.h5\n")}) {
    const auto nominal = nominal_stage_of(info, write(text));
    ASSERT_TRUE(nominal);
    EXPECT_FALSE(nominal->rigid_body);
    for (const double hz : {3.0, 40.0, 333.0}) {
      const Eigen::MatrixXcd truth = -test::small_stage().controller(2.0 * std::numbers::pi * hz);
      EXPECT_LT((nominal->controller(hz) - truth).norm(), 1e-3 * truth.norm()) << text << hz;
    }
  }
}

// An integrator, x+ = x + T y, u = -5 x; and its transfer function 5 T / (z - 1).
TEST_F(ControllerFileTest, DiscreteMatricesAreOnTheUnitCircle) {
  const std::string names =
      "format: stageid-controller\nsensors: [z]\nactuators: [a]\n"
      "sample_rate_hz: 1000\n";
  const NominalStage states = read_controller_file(
      YamlDocument::parse("c.yaml", names + "state_space: {a: [1], b: [0.001], c: [5]}\n"));
  const NominalStage fraction = read_controller_file(YamlDocument::parse(
      "c.yaml", names + "transfer: [{actuator: a, sensor: z, numerator: [0.005], denominator: [1, "
                        "-1]}]\n"));
  for (const double hz : {1.0, 77.0, 400.0}) {
    const std::complex<double> z = std::polar(1.0, 2.0 * std::numbers::pi * hz / 1000.0);
    EXPECT_LT(std::abs(states.controller(hz)(0, 0) + 0.005 / (z - 1.0)), 1e-12);
    EXPECT_LT(std::abs(fraction.controller(hz)(0, 0) + 0.005 / (z - 1.0)), 1e-12);
  }
}

TEST_F(ControllerFileTest, FindsWhatIsRecordedUnderAWrongNameOrSign) {
  write_measured();
  for (const std::string& text : {transfer_text(), state_space_text(),
                                  std::string("format: stageid-controller\nmeasured: c.h5\n")}) {
    MemoryLog log = small_log();
    const auto nominal = nominal_stage_of(log.log_info, write(text));
    for (const Finding& f : check_health(read_health_record({&log}, {}), nominal)) {
      EXPECT_EQ(f.severity, Severity::unchecked) << text << f.channel << ": " << f.what;
      if (f.cause == Cause::rigid_body) {
        EXPECT_THAT(f.remedy, HasSubstr("stage: FILE"));
      }
    }
    for (LogSamples& record : log.records) record.sensors.col(0).swap(record.sensors.col(1));
    const auto swapped = check_health(read_health_record({&log}, {}), nominal);
    ASSERT_FALSE(swapped.empty());
    EXPECT_EQ(swapped[0].cause, Cause::swapped) << text;
    EXPECT_EQ(swapped[0].channel, "z1 z2");
    log = small_log();
    for (LogSamples& record : log.records) record.actuators.col(1) *= -1.0;
    const auto sign = check_health(read_health_record({&log}, {}), nominal);
    ASSERT_FALSE(sign.empty());
    EXPECT_EQ(sign[0].cause, Cause::sign) << text;
    EXPECT_EQ(sign[0].channel, "a2");
  }
}

TEST_F(ControllerFileTest, WhatIsWrongIsSaidWithItsPlace) {
  EXPECT_THAT(
      error_of(head("state_space: {a: [1, 2, 3], b: [1], c: [1]}\nsample_rate_hz: 1\n")),
      AllOf(HasSubstr("c.yaml:4:"), HasSubstr("a: got 3 numbers"), HasSubstr("row by row")));
  EXPECT_THAT(error_of(head("state_space: {d: [1, 2, 3, 4, 5, 6]}\n")),
              HasSubstr("required for a discrete controller"));
  EXPECT_THAT(error_of(head("sample_rate_hz: 1000\n")),
              HasSubstr("write exactly one of state_space, transfer and measured"));
  EXPECT_THAT(error_of(head("measured: c.h5\nstate_space: {d: [1, 2, 3, 4, 5, 6]}\n")),
              HasSubstr("write exactly one of state_space, transfer and measured"));
  EXPECT_THAT(error_of(head("time: continuous\ntransfer: [{actuator: a9, sensor: z1, numerator: "
                            "[1], denominator: [1]}]\n")),
              HasSubstr("'a9' is not in the list"));
  EXPECT_THAT(error_of(head("time: continuous\ntransfer: [{actuator: a1, sensor: z1, numerator: "
                            "[1], denominator: [0, 0]}]\n")),
              HasSubstr("denominator: all coefficients are zero"));
  EXPECT_THAT(error_of(head("time: continuous\nstate_spaces: {}\n")),
              HasSubstr("unknown key 'state_spaces'"));
  EXPECT_THAT(error_of("format: stageid-controller\ntime: continuous\nstate_space: {d: [1]}\n"),
              HasSubstr("a matrix of 0 x 0"));  // without names of the channels
  EXPECT_THROW(nominal_stage_of(small_log().log_info,
                                write("format: stageid-controller\nmeasured: none.h5\n")),
               FileError);
}

}  // namespace stageid::test_controller_file
