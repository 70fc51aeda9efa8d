#pragma once

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include "acquisition/loop/measurement_loop.hpp"
#include "tests/support/stages/analytic_stage.hpp"

// A small stage in closed loop, the loop's excitation, and decoded rows.
namespace stageid::test::measurement_loop {

inline constexpr int kActuators = 3;
inline constexpr int kSensors = 2;
inline constexpr int kPeriod = 20;
inline constexpr std::uint64_t kSamples = 3 * kPeriod;

/// A decoded row of the ring.
struct Row {
  Eigen::VectorXd u;
  Eigen::VectorXd y;
  SampleStatus status;
};

struct MeasurementLoopTest : ::testing::Test {
  MeasurementLoopTest() : controller_(analytic_controller(stage_.info())) {
    excitation_.period = Eigen::MatrixXd::Zero(kPeriod, 3);
    for (int n = 0; n < kPeriod; ++n) {
      excitation_.period(n, 0) = 1.0 + n;
      excitation_.period(n, 2) = std::sin(n);
    }
    excitation_.actuators = {2, 1, 0};
    excitation_.samples = kSamples;
  }

  /// Every `every`-th exchange of [from, to) does this instead of `ok`.
  void script(std::uint64_t from, std::uint64_t to, Outcome outcome, std::uint64_t every = 1) {
    stage_.outcomes.clear();
    for (std::uint64_t n = from; n < to; n += every) stage_.outcomes[n] = outcome;
  }

  MeasurementLoop make_loop(const LoopOptions& options = {.ramp_s = 0.01}) {
    return MeasurementLoop(stage_, controller_, ring_, options);
  }

  /// One run of a new loop to the end; rows() has only its rows.
  MeasurementLoop& perform(const LoopOptions& options = {.ramp_s = 0.01}) {
    ring_.pop(static_cast<std::size_t>(ring_.pushed() - ring_.popped()));
    loop_.emplace(stage_, controller_, ring_, options);
    loop_->start(1, excitation_);
    run(*loop_);
    return *loop_;
  }

  /// Runs to the end; the ring is large enough.
  static void run(MeasurementLoop& loop) {
    while (loop.step() == LoopStatus::running) {
    }
  }

  std::vector<Row> rows() {
    std::vector<Row> all;
    const auto words = ring_.front(ring_.capacity_rows());
    for (std::size_t at = 0; at < words.size(); at += ring_.row_words()) {
      const double* const row = words.data() + at;
      all.push_back({Eigen::Map<const Eigen::VectorXd>(row, kActuators),
                     Eigen::Map<const Eigen::VectorXd>(row + kActuators, kSensors),
                     unpack_status(std::bit_cast<std::uint64_t>(row[kActuators + kSensors]))});
    }
    return all;
  }

  static std::set<std::size_t> marked(const std::vector<Row>& rows) {
    std::set<std::size_t> which;
    for (std::size_t n = 0; n < rows.size(); ++n) {
      if (rows[n].status.marked) which.insert(n);
    }
    return which;
  }

  /// r[n] as expected at the actuators.
  Eigen::VectorXd excitation_at(std::uint64_t n) const {
    Eigen::VectorXd r = Eigen::VectorXd::Zero(kActuators);
    const auto row = static_cast<Eigen::Index>(n % kPeriod);
    for (Eigen::Index c = 0; c < 3; ++c) r[excitation_.actuators[c]] += excitation_.period(row, c);
    return r;
  }

  /// Output of a separate controller for the recorded y.
  std::vector<Eigen::VectorXd> controls(const std::vector<Row>& rows) const {
    MotionController again(analytic_controller(stage_.info()));
    std::vector<Eigen::VectorXd> all;
    for (const Row& row : rows) {
      Eigen::VectorXd u(kActuators);
      again.update(row.y.data(), u.data());
      all.push_back(u);
    }
    return all;
  }

  AnalyticStage stage_{kActuators, kSensors};
  MotionController controller_;
  SampleRing ring_{kActuators + kSensors + 1, 1024};
  LoopExcitation excitation_;
  std::optional<MeasurementLoop> loop_;
};

}  // namespace stageid::test::measurement_loop
