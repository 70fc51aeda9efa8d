#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "acquisition/loop/run_resident.hpp"
#include "hal/can/can_node.hpp"
#include "hal/can/can_resident_stage.hpp"
#include "hal/can/can_stage.hpp"
#include "tests/acquisition/days/misfortune.hpp"
#include "tests/acquisition/days/stage_witness.hpp"
#include "tests/hal/can/altered_can.hpp"
#include "tests/support/stages/can_pair.hpp"
#include "tests/support/stages/simulated_spec.hpp"

namespace stageid::test {

enum class Link : std::uint8_t { direct, streaming, resident };

/// All channels on one virtual bus, which is fast enough for 10 kHz. Ranges beyond the limits.
inline CanSpec day_bus(const SimulatedSpec& stage) {
  CanBusSpec bus{"pair0", 10e6, 80e6, {}, {}};
  bus.actuators.resize(stage.info.actuators.size());
  bus.sensors.resize(stage.info.sensors.size());
  std::iota(bus.actuators.begin(), bus.actuators.end(), 0);
  std::iota(bus.sensors.begin(), bus.sensors.end(), 0);
  CanSpec can;
  can.buses = {bus};
  for (const double limit_n : stage.limits.actuator_n)
    can.actuator_range_n.push_back(1.25 * limit_n);
  for (const double window_m : stage.limits.position_window_m)
    can.sensor_range_m.push_back(4.0 * window_m);
  return can;
}

/// The host's stage, directly or over CAN. The simulated stage is at the far end, behind the witness.
class DayLink {
 public:
  DayLink(SimulatedSpec spec, Link link, const Misfortune& misfortune, Testimony& testimony,
          RandomNumbers& random)
      : spec_(std::move(spec)), misfortune_(misfortune), random_(random) {
    auto witness = std::make_unique<StageWitness>(
        simulated(spec_), complete_limits(spec_.limits, spec_.info), testimony,
        [this](std::uint64_t exchange) { strike(exchange); });
    if (link == Link::direct) {
      host_ = std::make_unique<LimitedStage>(std::move(witness), spec_.limits);
      return;
    }
    const CanSpec can = day_bus(spec_);
    node_ = std::make_unique<StageNode>(std::move(witness), spec_.limits, spec_.controller,
                                        NodePanel{}, NodeOptions{.watchdog_s = can.watchdog_s});
    node_bus_ = std::make_unique<AlteredCan>(pair_.node(), spoil());
    front_ = std::make_unique<CanNode>(*node_, can_layout(can, spec_.info), *node_bus_);
    pair_.when_host_waits([this] { serve(); });
    const CanHostOptions options{.reset_fault = true};
    auto host_bus = std::make_unique<AlteredCan>(pair_.host(), spoil());
    if (link == Link::resident)
      resident_ = std::make_unique<CanResidentStage>(spec_.info, can, std::move(host_bus), options);
    else
      host_ = std::make_unique<LimitedStage>(
          std::make_unique<CanStage>(spec_.info, can, std::move(host_bus), options), spec_.limits);
  }
  DayLink(DayLink&&) = delete;

  ExperimentResult perform(const ExperimentPlan& plan, RunWriter& log,
                           RunExperimentOptions options) {
    options.interrupt = &interrupt_;
    options.plant_tripped = &tripped_;
    if (resident_) return run_resident_experiment(plan, *resident_, log, options);
    MotionController controller(spec_.controller);
    return run_experiment(plan, *host_, controller, log, options);
  }

  /// The host is gone; a node notices it by itself.
  void pass_rest() {
    if (node_ == nullptr) return;
    for (int ms = 0; ms < kRest_ms; ++ms) {
      pair_.pass_time(1'000'000);
      serve();
    }
  }

 private:
  static constexpr int kRest_ms = 1000;

  void strike(std::uint64_t exchange) {
    if (exchange != misfortune_.at) return;
    struck_ = true;
    if (misfortune_.has(Trouble::interrupted)) interrupt_ = true;
    if (misfortune_.has(Trouble::tripped)) tripped_ = true;
  }

  void serve() {
    if (std::exchange(struck_, false)) {
      cut_ = misfortune_.has(Trouble::cut);
      if (misfortune_.has(Trouble::bus)) pair_.set_state(0, CanBusState::off);
      if (misfortune_.has(Trouble::interlock)) {
        NodePanel open;
        open.interlock_closed = false;
        node_->set_panel(open);
      }
    }
    front_->serve(0);
  }

  AlteredCan::Alter spoil() {
    return [this, late = std::optional<CanFrame>{}](std::span<CanFrame> frames,
                                                    std::size_t count) mutable {
      if (cut_) return std::size_t{0};
      if (!misfortune_.has(Trouble::wire)) return count;
      std::vector<CanFrame> after;
      if (late && random_.uniform() < 0.5) after.push_back(*std::exchange(late, {}));
      std::size_t kept = 0;
      for (std::size_t i = 0; i < count; ++i) {
        CanFrame& frame = frames[kept++] = frames[i];
        switch (random_.uniform() < misfortune_.frames_spoiled ? random_.integer(0, 5) : -1) {
          case 0:
            frame.data[static_cast<std::size_t>(random_.integer(0, 63))] ^= 4;
            break;
          case 1:
            frame.length /= 2;
            break;
          case 2:
            frame.id ^= 1;
            break;
          case 3:
            after.push_back(frame);  // arrives twice
            break;
          case 4:
            late = frame;
            [[fallthrough]];
          case 5:
            --kept;  // lost
            break;
          default:
            break;
        }
      }
      for (const CanFrame& frame : after)
        if (kept < frames.size()) frames[kept++] = frame;
      return kept;
    };
  }

  SimulatedSpec spec_;
  const Misfortune& misfortune_;
  RandomNumbers& random_;
  CanPair pair_{{"pair0"}};
  std::unique_ptr<StageNode> node_;
  std::unique_ptr<CanTransport> node_bus_;
  std::unique_ptr<CanNode> front_;
  std::unique_ptr<LimitedStage> host_;  // one of these two
  std::unique_ptr<CanResidentStage> resident_;
  std::atomic<bool> interrupt_ = false;
  std::atomic<bool> tripped_ = false;
  bool struck_ = false;
  bool cut_ = false;
};

}  // namespace stageid::test
