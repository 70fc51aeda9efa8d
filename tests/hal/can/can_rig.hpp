#pragma once

#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "hal/can/can_node.hpp"
#include "hal/can/can_resident_stage.hpp"
#include "hal/can/can_stage.hpp"
#include "hal/can/faulty_can.hpp"
#include "hal/node/stage_node.hpp"
#include "tests/hal/node/small_node.hpp"
#include "tests/support/stages/can_pair.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test {

/// All channels of a stage on one bus.
inline CanSpec one_bus_spec(const StageInfo& info, double data_bit_rate_hz = 5e6) {
  CanSpec spec;
  spec.buses = {{"can0", 1e6, data_bit_rate_hz, {}, {}}};
  spec.buses[0].actuators.resize(info.actuators.size());
  spec.buses[0].sensors.resize(info.sensors.size());
  std::iota(spec.buses[0].actuators.begin(), spec.buses[0].actuators.end(), 0);
  std::iota(spec.buses[0].sensors.begin(), spec.buses[0].sensors.end(), 0);
  spec.actuator_range_n.assign(info.actuators.size(), 62.5);
  spec.sensor_range_m.assign(info.sensors.size(), 250e-6);
  return spec;
}

inline std::vector<CanFault> can_faults(const std::vector<std::string>& texts) {
  std::vector<CanFault> faults;
  for (const std::string& text : texts) faults.push_back(parse_can_fault(text));
  return faults;
}

struct CanRigOptions {
  std::vector<std::string> host_faults;  ///< of setpoint frames
  std::vector<std::string> node_faults;  ///< of measurement frames
  int buses = 1;                         ///< actuator a2 on the second
};

/// A simulated stage of two actuators and one sensor behind buses within the process, at 1 kHz. The node works while
/// the host waits, and the time is that of the bus.
class CanRig {
 public:
  explicit CanRig(CanRigOptions options = {}, SimulatedSpec stage = quiet_stage())
      : stage_spec_(std::move(stage)),
        spec_(can_spec(options.buses)),
        layout_(can_layout(spec_, stage_spec_.info)),
        pair_(names(options.buses)),
        node_bus_(pair_.node(), can_faults(options.node_faults)),
        host_faults_(can_faults(options.host_faults)) {
    boot();
  }

  static SimulatedSpec quiet_stage() {
    SimulatedSpec spec = small_stage_spec();
    spec.limits.actuator_n = Eigen::VectorXd::Constant(2, 50.0);
    spec.limits.position_window_m = Eigen::VectorXd::Constant(1, 1e-3);
    spec.controller = one_axis_controller(spec.info.sample_rate_hz, 10.0, 100.0);
    spec.controller.actuator_decoupling.setOnes();
    return spec;
  }

  StageNode new_node(double watchdog_s = 0.02) const {
    return StageNode(simulated(stage_spec_), stage_spec_.limits, stage_spec_.controller,
                     NodePanel{}, {.watchdog_s = watchdog_s});
  }

  /// Replaces the node by a new one, as after a restart.
  void boot() {
    front_.reset();
    stage_node_.reset(new StageNode(new_node(spec_.watchdog_s)));
    front_ = std::make_unique<CanNode>(*stage_node_, layout_, node_bus_);
    thaw();
  }
  void freeze() {
    pair_.when_host_waits([] {});
  }
  void thaw() {
    pair_.when_host_waits([this] { front_->serve(0); });
  }
  /// Runs the node alone for this time.
  void serve_ms(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) {
      pair_.pass_time(1'000'000);
      front_->serve(0);
    }
  }

  std::unique_ptr<CanTransport> host_bus() {
    return std::make_unique<FaultyCan>(pair_.host(), host_faults_);
  }
  std::unique_ptr<CanStage> host(CanHostOptions options = {}) {
    return std::make_unique<CanStage>(stage_spec_.info, spec_, host_bus(), options);
  }

  std::unique_ptr<CanResidentStage> resident() {
    return std::make_unique<CanResidentStage>(stage_spec_.info, spec_, host_bus(),
                                              CanHostOptions{});
  }

  void send_to_node(const CanFrame& frame) { static_cast<void>(pair_.host().send({&frame, 1})); }
  void send_to_host(const CanFrame& frame) { static_cast<void>(pair_.node().send({&frame, 1})); }

  const SimulatedSpec& stage_spec() const { return stage_spec_; }
  const CanSpec& spec() const { return spec_; }
  const CanLayout& layout() const { return layout_; }
  CanPair& pair() { return pair_; }
  StageNode& node() { return *stage_node_; }
  CanNode& front() { return *front_; }

 private:
  static std::vector<std::string> names(int buses) {
    std::vector<std::string> list;
    for (int i = 0; i < buses; ++i) list.push_back("pair" + std::to_string(i));
    return list;
  }
  static CanSpec can_spec(int buses) {
    CanSpec spec;
    spec.buses.push_back({"pair0", 1e6, 5e6, {0}, {0}});
    if (buses > 1) spec.buses.push_back({"pair1", 1e6, 5e6, {}, {}});
    spec.buses.back().actuators.push_back(1);
    spec.actuator_range_n = {62.5, 62.5};
    spec.sensor_range_m = {1.25e-3};
    return spec;
  }

  SimulatedSpec stage_spec_;
  CanSpec spec_;
  CanLayout layout_;
  CanPair pair_;
  FaultyCan node_bus_;
  std::vector<CanFault> host_faults_;
  std::unique_ptr<StageNode> stage_node_;
  std::unique_ptr<CanNode> front_;
};

}  // namespace stageid::test
