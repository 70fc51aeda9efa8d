#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "tests/hal/can/can_rig.hpp"

namespace stageid::test {

/// A host that sends commands and records the outcome of each exchange.
class CanHost {
 public:
  explicit CanHost(CanRig& rig, CanHostOptions options = {}) : stage_(rig.host(options)) {
    inputs_.y = y_;
  }
  void start(std::uint64_t seed = 7) { stage_->start(seed, inputs_); }
  Outcome exchange() {
    const double u = command(cycle_);
    const std::vector<double> both{u, -0.5 * u};
    const Outcome outcome = stage_->exchange({cycle_++, both}, inputs_, {});
    // Ignored: a run on the wall clock may be late on a busy machine.
    return outcome == Outcome::late ? Outcome::ok : outcome;
  }
  std::vector<Outcome> exchange(int count) {
    std::vector<Outcome> outcomes;
    for (int i = 0; i < count; ++i) outcomes.push_back(exchange());
    return outcomes;
  }
  /// An even multiple of the counts of the bus, so that the wire adds no rounding.
  static double command(std::uint64_t cycle) {
    const double counts = 2.0 * std::nearbyint(5e4 * std::sin(0.3 * static_cast<double>(cycle)));
    return counts * 62.5 / kCanCountsOfRange;
  }
  CanStage& stage() { return *stage_; }
  const std::vector<double>& y() const { return y_; }
  const Inputs& inputs() const { return inputs_; }

 private:
  std::unique_ptr<CanStage> stage_;
  std::vector<double> y_ = std::vector<double>(1);
  Inputs inputs_;
  std::uint64_t cycle_ = 0;
};

/// The same after its start.
struct RunningCanHost : CanHost {
  explicit RunningCanHost(CanRig& rig, CanHostOptions options = {}) : CanHost(rig, options) {
    start();
  }
};

/// What the sensor measures in an undisturbed run.
inline std::vector<double> undisturbed_can_run(int samples) {
  CanRig rig;
  RunningCanHost host(rig);
  std::vector<double> y;
  for (int n = 0; n < samples; ++n) {
    EXPECT_EQ(host.exchange(), Outcome::ok);
    y.push_back(host.y()[0]);
  }
  return y;
}

inline std::vector<Outcome> all_ok(int count) { return std::vector<Outcome>(count, Outcome::ok); }

}  // namespace stageid::test
