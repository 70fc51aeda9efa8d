#pragma once

#include <fmt/format.h>

#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <utility>

#include "acquisition/loop/measurement_loop.hpp"
#include "hal/can/can_node.hpp"
#include "hal/can/can_resident_stage.hpp"
#include "hal/can/can_stage.hpp"
#include "hal/can/can_zeromq.hpp"
#include "hal/modbus/modbus_stage.hpp"
#include "hal/node/stage_node.hpp"
#include "hal/plugin/plugin_stage.hpp"
#include "tests/hal/can/router_can.hpp"
#include "tests/hal/modbus/modbus_bench.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/can_pair.hpp"
#include "tests/support/stages/stop_case.hpp"

// One measurement of the stage of stop_case.hpp over each kind of link, with peers in this process.
namespace stageid::test {

enum class StopLink : std::uint8_t { sim, can, resident, modbus, plugin, zeromq };

inline const char* to_string(StopLink link) {
  constexpr std::array kNames = {"sim",    "CAN streaming", "CAN resident",
                                 "Modbus", "plugin",        "ZeroMQ resident"};
  return kNames[static_cast<std::size_t>(link)];
}

/// What happens to the link or the host in cycle kFaultCycle.
enum class LinkEvent : std::uint8_t { none, wire_lost, host_killed };

struct Stopped {
  StopReason reason = StopReason::none;
  bool host_lost = false;  // killed, so there is no reason
  std::string message;
  double largest_m = 0.0;
  double largest_n = 0.0;
  double speed_m_s = 0.0;   // when the forces were cut
  double coasted_m = 0.0;   // largest excursion in the second after that
  double stopping_s = 0.0;  // from the fault until the forces were cut, as the stage counts time
  std::uint64_t marked = 0;
  double largest_logged_n = 0.0;

  int exit_code() const {
    if (reason == StopReason::none) return marked > 0 ? 3 : 0;
    return reason == StopReason::limit ? 4 : 1;
  }
};

inline constexpr int kStopPeriod = 1000;
inline constexpr std::uint64_t kStopSamples = 10'000;
inline constexpr double kStopRamp_s = 0.1;
inline constexpr int kRest_ms = 2500;  // more than the host's silence and the hold of a node

/// 10 N rms between 10 Hz and 1 kHz: healthy motions of 7 um and 1.1 mm/s.
inline LoopExcitation healthy_excitation() {
  LoopExcitation excitation;
  excitation.period = Eigen::MatrixXd::Zero(kStopPeriod, 1);
  constexpr int kLines = 100;
  const double amplitude = 10.0 / std::sqrt(0.5 * kLines);
  for (int line = 1; line <= kLines; ++line)
    for (int n = 0; n < kStopPeriod; ++n)
      excitation.period(n, 0) +=
          amplitude * std::cos(2.0 * std::numbers::pi * line * n / kStopPeriod +
                               std::numbers::pi * line * (line - 1) / kLines);
  excitation.actuators = {0};
  excitation.samples = kStopSamples;
  return excitation;
}

inline void take_motion(const WatchedStage& watch, const SimulatedSpec& spec, Stopped& result) {
  result.largest_m = watch.largest_m;
  result.largest_n = watch.largest_n;
  result.speed_m_s = watch.speed_m_s();
  result.coasted_m = watch.coasted_m();
  result.stopping_s = (static_cast<double>(watch.cycles) - kFaultCycle) / spec.info.sample_rate_hz;
}

/// The host's loop around a stage. `disturb` is called in cycle kFaultCycle; false: the host is dead.
template <typename Disturb>
Stopped stream(LimitedStage& stage, const SimulatedSpec& spec, Disturb disturb) {
  MotionController controller(spec.controller);
  SampleRing ring(3, 1U << 15);
  MeasurementLoop loop(stage, controller, ring, {.ramp_s = kStopRamp_s});
  loop.start(3, healthy_excitation());
  Stopped result;
  for (std::uint64_t cycle = 0; !result.host_lost; ++cycle) {
    if (cycle == kFaultCycle) result.host_lost = !disturb();
    if (!result.host_lost && loop.step() != LoopStatus::running) break;
  }
  result.reason = loop.reason();
  result.message = describe_stop(stage);
  const std::string trouble = stage.trouble();
  if (stage.violation().kind == LimitKind::none && !trouble.empty()) result.message = trouble;
  const auto words = ring.front(ring.capacity_rows());
  for (std::size_t at = 0; at < words.size(); at += ring.row_words()) {
    const bool marked = unpack_status(std::bit_cast<std::uint64_t>(words[at + 2])).marked;
    result.marked += marked ? 1U : 0U;
    result.largest_logged_n = std::max(result.largest_logged_n, std::abs(words[at]));
  }
  return result;
}

inline Stopped stop_in_process(const SimulatedSpec& spec, bool as_plugin) {
  auto watched = std::make_unique<WatchedStage>(spec);
  const WatchedStage& watch = *watched;
  std::unique_ptr<CyclicStage> owner;
  std::unique_ptr<CyclicStage> link = std::move(watched);
  if (as_plugin) {
    owner = std::move(link);
    link = std::make_unique<PluginStage>(
        spec.info,
        PluginSpec{STAGEID_STOP_PLUGIN,
                   {{"stage", std::to_string(reinterpret_cast<std::uintptr_t>(owner.get()))}}},
        0.0);
  }
  LimitedStage stage(std::move(link), spec.limits);
  Stopped result = stream(stage, spec, [] { return true; });
  take_motion(watch, spec, result);
  return result;
}

/// A bus that can be cut, in both directions.
class CutCan final : public CanThrough {
 public:
  CutCan(CanTransport& inner, const bool& cut) : CanThrough(inner), cut_(cut) {}
  std::size_t send(std::span<const CanFrame> frames) noexcept override {
    return cut_ ? frames.size() : CanThrough::send(frames);
  }
  std::size_t receive(std::span<CanFrame> frames) noexcept override {
    const std::size_t count = CanThrough::receive(frames);
    return cut_ ? 0 : count;
  }

 private:
  const bool& cut_;
};

inline CanSpec stop_can_spec(const std::string& interface) {
  CanSpec can;
  can.buses.push_back({interface, 10e6, 80e6, {0}, {0}});  // virtual: 10 kHz fit
  can.actuator_range_n = {1.25 * kStopForce};
  can.sensor_range_m = {1.25 * kStopWindow};
  return can;
}

/// The node behind CAN, in the same thread.
class CanStopRig {
 public:
  CanStopRig(const SimulatedSpec& spec, double pace) {
    auto watched = std::make_unique<WatchedStage>(spec);
    watch_ = watched.get();
    node_ = std::make_unique<StageNode>(std::move(watched), spec.limits, spec.controller,
                                        NodePanel{}, NodeOptions{.watchdog_s = can_.watchdog_s});
    front_ = std::make_unique<CanNode>(*node_, can_layout(can_, spec.info), pair_.node(), pace);
    pair_.when_host_waits([this] { front_->serve(0); });
  }
  std::unique_ptr<CanTransport> host_bus() { return std::make_unique<CutCan>(pair_.host(), cut_); }
  const CanSpec& can() const { return can_; }
  void cut() { cut_ = true; }
  void pass_ms(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) {
      pair_.pass_time(1'000'000);
      front_->serve(0);
    }
  }
  const WatchedStage& at_rest() {
    pass_ms(kRest_ms);
    return *watch_;
  }

 private:
  CanSpec can_ = stop_can_spec("pair0");
  CanPair pair_{{"pair0"}};
  bool cut_ = false;
  const WatchedStage* watch_ = nullptr;
  std::unique_ptr<StageNode> node_;
  std::unique_ptr<CanNode> front_;
};

/// The node behind ZeroMQ, in a thread of its own on the clock of this computer.
class ZeroMqStopRig {
 public:
  ZeroMqStopRig(const SimulatedSpec& spec, double pace)
      : can_(stop_can_spec("ipc://" + (directory_ / "node").string())),
        router_(can_.buses[0].interface),
        host_(can_.buses[0].interface) {
    auto watched = std::make_unique<WatchedStage>(spec);
    watch_ = watched.get();
    node_ = std::make_unique<StageNode>(std::move(watched), spec.limits, spec.controller,
                                        NodePanel{}, NodeOptions{.watchdog_s = can_.watchdog_s});
    front_ = std::make_unique<CanNode>(*node_, can_layout(can_, spec.info), router_, pace);
    thread_ = std::thread([this] {
      while (!stop_) front_->serve(router_.now_ns() + 1'000'000);
    });
  }
  ~ZeroMqStopRig() { end(); }
  ZeroMqStopRig(ZeroMqStopRig&&) = delete;

  std::unique_ptr<CanTransport> host_bus() { return std::make_unique<CutCan>(host_, cut_); }
  const CanSpec& can() const { return can_; }
  void cut() { cut_ = true; }
  static void pass_ms(int milliseconds) {
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
  }
  const WatchedStage& at_rest() {
    for (int i = 0; i < kRest_ms && node_->state() > NodeState::operation_enabled &&
                    node_->state() != NodeState::fault;
         ++i)
      pass_ms(1);
    end();
    return *watch_;
  }

 private:
  void end() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }

  TemporaryDirectory directory_;
  CanSpec can_;
  RouterCan router_;
  ZeroMqCan host_;
  bool cut_ = false;
  const WatchedStage* watch_ = nullptr;
  std::unique_ptr<StageNode> node_;
  std::unique_ptr<CanNode> front_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

inline Stopped stop_over_can(const SimulatedSpec& spec, LinkEvent event) {
  CanStopRig rig(spec, 0.0);
  Stopped result;
  {
    LimitedStage stage(
        std::make_unique<CanStage>(spec.info, rig.can(), rig.host_bus(), CanHostOptions{}),
        spec.limits);
    result = stream(stage, spec, [&] {
      if (event != LinkEvent::none) rig.cut();
      return event != LinkEvent::host_killed;
    });
  }
  take_motion(rig.at_rest(), spec, result);
  return result;
}

/// @tparam Rig CanStopRig or ZeroMqStopRig
template <typename Rig>
Stopped stop_resident(const SimulatedSpec& spec, LinkEvent event, double pace) {
  Rig rig(spec, pace);
  Stopped result;
  CanResidentStage stage(spec.info, rig.can(), rig.host_bus(), CanHostOptions{});
  try {
    Waveforms waveforms;
    waveforms.samples = healthy_excitation().period;
    waveforms.periods = static_cast<int>(kStopSamples) / kStopPeriod;
    static_cast<void>(stage.upload(waveforms));
    JobProgress progress = stage.arm({0, 3, kStopRamp_s});
    while (progress.status == JobStatus::running) {
      if (event != LinkEvent::none && progress.done >= kFaultCycle) {
        rig.cut();
        result.host_lost = event == LinkEvent::host_killed;
        if (result.host_lost) break;
      }
      rig.pass_ms(20);  // as often as `stageid run` asks
      progress = stage.poll();
    }
    if (progress.status == JobStatus::failed) {
      result.reason = progress.outcome == Outcome::limit ? StopReason::limit : StopReason::fault;
      result.message = progress.message;
    }
    if (!result.host_lost)
      static_cast<void>(stage.download([&](auto, std::span<const Outcome> outcomes) {
        for (const Outcome outcome : outcomes) result.marked += outcome != Outcome::ok ? 1 : 0;
      }));
  } catch (const StageError& error) {
    result.reason = StopReason::fault;
    result.message = error.what();
  }
  take_motion(rig.at_rest(), spec, result);
  return result;
}

/// A server in a thread of its own, on the clock of this computer.
inline Stopped stop_over_modbus(const SimulatedSpec& spec, LinkEvent event) {
  constexpr ModbusTiming kTiming = {0.1, 0.2, 5e-5};
  constexpr int kStartRequests = 7;  // as in modbus_stage_test.cpp
  auto watched = std::make_unique<WatchedStage>(spec);
  const WatchedStage& watch = *watched;
  StageNode node(std::move(watched), spec.limits, spec.controller, NodePanel{},
                 {.watchdog_s = modbus_longest_pause_s(kTiming, spec.info.sample_rate_hz)});
  std::vector<std::string> faults;
  if (event == LinkEvent::wire_lost)
    faults.push_back(fmt::format("dead_server@{}", kStartRequests + kFaultCycle));
  ModbusFaultScript script(modbus_faults(faults));
  ModbusNode registers(node, spec.limits, 4711, &script, 1.0);
  Stopped result;
  {
    ServerThread server(registers, &script);
    {
      LimitedStage stage(std::make_unique<ModbusStage>(spec.info, server.address(), kTiming),
                         spec.limits);
      result = stream(stage, spec, [&] { return event != LinkEvent::host_killed; });
    }
    for (int i = 0; i < kRest_ms; ++i) {
      const NodeState state = node.state();
      if (state == NodeState::fault || state == NodeState::switch_on_disabled) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      node.tick(monotonic_ns());  // the server is dead, its node is not
    }
  }
  take_motion(watch, spec, result);
  return result;
}

inline Stopped stop_over(StopLink link, const SimulatedSpec& spec, LinkEvent event) {
  switch (link) {
    case StopLink::can:
      return stop_over_can(spec, event);
    case StopLink::resident:
      return stop_resident<CanStopRig>(spec, event, 1.0);
    case StopLink::zeromq:
      // Without an event, it need not last as long as the run.
      return stop_resident<ZeroMqStopRig>(spec, event, event == LinkEvent::none ? 0.0 : 1.0);
    case StopLink::modbus:
      return stop_over_modbus(spec, event);
    case StopLink::sim:
    case StopLink::plugin:
      break;
  }
  return stop_in_process(spec, link == StopLink::plugin);
}

}  // namespace stageid::test
