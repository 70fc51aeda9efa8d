// The device on the other side of docs/examples/plugin/udp_stage.c: the simulated stage of a stage file behind UDP, with
// a watchdog of its own.
//
//   udp_peer STAGE.yaml [CYCLES] [PORT] [WATCHDOG_S]
//
// Prints its port, and a line per stop without the host. After CYCLES cycles of all runs, the wire is cut; 0: never.

#include <arpa/inet.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "hal/node/stage_node.hpp"
#include "hal/stage/pacer.hpp"
#include "tests/support/stages/stop_case.hpp"
#include "tools/config/stage_config.hpp"

namespace {

using namespace stageid;

constexpr std::uint64_t kStart = ~std::uint64_t{0};

struct Datagram {
  std::uint64_t cycle = 0;
  std::array<double, 64> values{};
};

class Device {
 public:
  Device(const test::SimulatedSpec& spec, double watchdog_s)
      : actuators_(spec.info.actuators.size()) {
    auto stage = std::make_unique<test::WatchedStage>(spec);
    watch_ = stage.get();
    node_ = std::make_unique<StageNode>(std::move(stage), spec.limits, spec.controller, NodePanel{},
                                        NodeOptions{.watchdog_s = watchdog_s});
    y_.resize(spec.info.sensors.size());
    inputs_.y = y_;
  }

  /// @returns the number of doubles in the answer; 0: none
  std::size_t take(const Datagram& in, Datagram& out) {
    if (in.cycle == kStart) {
      std::uint64_t seed = 0;
      std::memcpy(&seed, in.values.data(), sizeof seed);
      static_cast<void>(node_->request(SupervisorCommand::reset_fault));
      static_cast<void>(node_->request(SupervisorCommand::enable));
      static_cast<void>(node_->begin_run(seed, monotonic_ns(), inputs_));
    } else {
      const Outcome outcome =
          node_->advance(monotonic_ns(), std::span(in.values).first(actuators_), inputs_);
      if (outcome == Outcome::fault) return 0;
      out.cycle = in.cycle + 1;
    }
    std::copy(y_.begin(), y_.end(), out.values.begin());
    return y_.size();
  }
  void end_run() { node_->end_run(); }
  void tick() {
    node_->tick(monotonic_ns());
    const bool rests = node_->state() == NodeState::fault;
    if (rests && !rested_) {
      const auto silent = static_cast<double>(watch_->cycles - node_->sample());
      fmt::print("{}: {:.0f} um, {:.0f} N, {:.0f} ms, {:.3g} mm/s\n", node_->trouble(),
                 1e6 * watch_->largest_m, watch_->largest_n,
                 1e3 * silent / node_->info().sample_rate_hz, 1e3 * watch_->speed_m_s());
      std::fflush(stdout);
    }
    rested_ = rests;
  }

 private:
  std::size_t actuators_;
  const test::WatchedStage* watch_ = nullptr;
  std::unique_ptr<StageNode> node_;
  std::vector<double> y_;
  Inputs inputs_;
  bool rested_ = false;
};

int serve(Device device, std::uint64_t cycles, std::uint16_t port) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  socklen_t size = sizeof address;
  if (::bind(socket, reinterpret_cast<sockaddr*>(&address), size) != 0) return 1;
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  fmt::print("{}\n", ntohs(address.sin_port));
  std::fflush(stdout);

  std::uint64_t received = 0;
  while (true) {
    pollfd waiting{socket, POLLIN, 0};
    static_cast<void>(::poll(&waiting, 1, 1));
    device.tick();
    if (waiting.revents == 0) continue;
    Datagram in;
    sockaddr_in host{};
    size = sizeof host;
    const ssize_t got =
        ::recvfrom(socket, &in, sizeof in, 0, reinterpret_cast<sockaddr*>(&host), &size);
    if (cycles > 0 && ++received > cycles) continue;
    if (got <= static_cast<ssize_t>(sizeof in.cycle)) {
      device.end_run();
      continue;
    }
    Datagram out;
    if (const std::size_t values = device.take(in, out); values > 0)
      ::sendto(socket, &out, sizeof out.cycle + values * sizeof(double), 0,
               reinterpret_cast<const sockaddr*>(&host), size);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  const std::uint64_t cycles = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 0;
  const int port = argc > 3 ? std::atoi(argv[3]) : 0;
  const double watchdog_s = argc > 4 ? std::atof(argv[4]) : 5.0;
  const StageConfig config = load_stage_config(argv[1]);
  const test::SimulatedSpec spec = {config.spec, config.plant.value(), config.simulation,
                                    config.pace};
  return serve({spec, watchdog_s}, cycles, static_cast<std::uint16_t>(port));
}
