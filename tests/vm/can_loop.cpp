// Streams a small simulated stage over SocketCAN and counts the errors: on the wall clock with a node in another
// process, or in virtual time with one in a thread, for the sanitizers.
//   can_loop INTERFACE RATE_HZ SECONDS process|thread
// Exit code 0: every sample was answered in its cycle or late, none is missing, and in "process" mode
// less than one in a thousand is late.

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "hal/can/can_node.hpp"
#include "hal/can/can_socket.hpp"
#include "hal/can/can_stage.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace {

using namespace stageid;

constexpr int kAttempts = 50;

struct Setup {
  test::SimulatedSpec stage = test::small_stage_spec();
  CanSpec can;
  std::string interface;
};

Setup make_setup(const std::string& interface, double rate_hz) {
  Setup setup;
  setup.interface = interface;
  setup.stage.info.sample_rate_hz = rate_hz;
  setup.stage.controller.sample_rate_hz = rate_hz;
  setup.stage.controller.sensor_decoupling = Eigen::MatrixXd::Ones(1, 1);
  setup.stage.controller.actuator_decoupling = Eigen::MatrixXd::Ones(2, 1);
  AxisController axis;
  axis.crossover_hz = 10.0;
  axis.gain = 100.0;
  setup.stage.controller.axes = {axis};
  setup.can.buses = {{interface, 4e6, 8e6, {0, 1}, {0}}};
  setup.can.actuator_range_n = {100.0, 100.0};
  setup.can.sensor_range_m = {0.1};
  setup.can.watchdog_s = 1.0;
  setup.can.largest_load = 1.0;
  return setup;
}

void serve(const Setup& setup, const std::atomic<bool>& end) {
  NodeOptions options;
  options.watchdog_s = setup.can.watchdog_s;
  StageNode node(test::simulated(setup.stage), setup.stage.limits, setup.stage.controller,
                 NodePanel{}, options);
  const CanLayout layout = can_layout(setup.can, setup.stage.info);
  SocketCan bus({setup.interface}, can_node_identifiers(layout));
  CanNode front(node, layout, bus);
  while (!end) front.serve(bus.now_ns() + 1'000'000);
}

/// @returns the number of samples for each outcome.
std::map<Outcome, int> stream(const Setup& setup, double seconds, double pace) {
  const CanLayout layout = can_layout(setup.can, setup.stage.info);
  CanStage stage(setup.stage.info, setup.can,
                 std::make_unique<SocketCan>(std::vector<std::string>{setup.interface},
                                             can_host_identifiers(layout)),
                 {pace, false});
  std::vector<double> y(1);
  std::vector<double> u(2);
  Inputs inputs;
  inputs.y = y;
  for (int attempt = 1;; ++attempt) {  // an emulated machine may take seconds to start the node
    try {
      stage.connect();
      break;
    } catch (const StageError&) {
      if (attempt == kAttempts) throw;
    }
  }
  stage.start(1, inputs);
  std::map<Outcome, int> outcomes;
  const double rate_hz = setup.stage.info.sample_rate_hz;
  const auto samples = static_cast<std::uint64_t>(rate_hz * seconds);
  for (std::uint64_t n = 0; n < samples; ++n) {
    u[0] = std::sin(0.1 * static_cast<double>(n));
    const Deadline deadline{pace > 0.0 ? inputs.t_sample_ns + std::llround(2e9 / rate_hz) : 0};
    ++outcomes[stage.exchange({n, u}, inputs, deadline)];
  }
  stage.stop();
  fmt::print("node: {} gaps, {} repeated, {} rejected, {} samples\n", stage.node().gaps,
             stage.node().repeated, stage.node().rejected, stage.node().sample);
  return outcomes;
}

int run(const Setup& setup, double seconds, bool threaded) {
  std::atomic<bool> end = false;
  std::thread thread;
  pid_t child = -1;
  if (threaded) {
    thread = std::thread([&] { serve(setup, end); });
  } else if ((child = fork()) == 0) {
    serve(setup, end);
    _exit(0);
  }
  std::map<Outcome, int> outcomes;
  try {
    outcomes = stream(setup, seconds, threaded ? 0.0 : 1.0);
  } catch (const StageError& error) {
    fmt::print("{}\n", error.what());
  }
  end = true;
  if (threaded) thread.join();
  if (child > 0) {
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
  }
  int samples = 0;
  bool missing = false;
  for (const auto& [outcome, count] : outcomes) {
    fmt::print("{}: {}\n", to_string(outcome), count);
    samples += count;
    missing |= outcome != Outcome::ok && outcome != Outcome::late;
  }
  const auto late = outcomes.find(Outcome::late);
  const bool many_late = late != outcomes.end() && 1000 * late->second > samples;
  return samples == 0 || missing || (many_late && !threaded) ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    fmt::print(stderr, "usage: can_loop INTERFACE RATE_HZ SECONDS process|thread\n");
    return 2;
  }
  try {
    const double rate_hz = std::atof(argv[2]);
    return run(make_setup(argv[1], rate_hz), std::atof(argv[3]), std::string(argv[4]) == "thread");
  } catch (const std::exception& error) {
    fmt::print(stderr, "can_loop: {}\n", error.what());
    return 2;
  }
}
