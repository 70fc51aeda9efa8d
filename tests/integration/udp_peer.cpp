// The stage on the other side of docs/examples/plugin/udp_stage.c: the simulated stage of a stage file behind UDP.
//
//   udp_peer STAGE.yaml [CYCLES] [PORT]     prints its port; silent after CYCLES cycles of all runs; 0: never

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <vector>

#include "hal/simulator/simulated_stage.hpp"
#include "tools/config/stage_config.hpp"

namespace {

using namespace stageid;

constexpr std::uint64_t kStart = ~std::uint64_t{0};

struct Datagram {
  std::uint64_t cycle = 0;
  std::array<double, 64> values{};
};

int serve(const WaferStageSpec& spec, std::uint64_t cycles, std::uint16_t port) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  socklen_t size = sizeof address;
  if (::bind(socket, reinterpret_cast<sockaddr*>(&address), size) != 0) return 1;
  ::getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  std::cout << ntohs(address.sin_port) << std::endl;

  SimulatedStage stage(spec);
  const std::size_t actuators = spec.info.actuators.size();
  std::vector<double> y(spec.info.sensors.size());
  Inputs inputs;
  inputs.y = y;
  while (true) {
    Datagram in;
    sockaddr_in host{};
    size = sizeof host;
    const ssize_t got =
        ::recvfrom(socket, &in, sizeof in, 0, reinterpret_cast<sockaddr*>(&host), &size);
    if (got <= static_cast<ssize_t>(sizeof in.cycle)) {
      stage.stop();
      continue;
    }
    if (cycles > 0 && --cycles == 0) return 0;
    Datagram out;
    if (in.cycle == kStart) {
      std::uint64_t seed = 0;
      std::memcpy(&seed, in.values.data(), sizeof seed);
      stage.start(seed, inputs);
    } else {
      static_cast<void>(
          stage.exchange({in.cycle, 0, std::span(in.values).first(actuators)}, inputs, {}));
      out.cycle = in.cycle + 1;
    }
    std::copy(y.begin(), y.end(), out.values.begin());
    ::sendto(socket, &out, sizeof out.cycle + y.size() * sizeof(double), 0,
             reinterpret_cast<const sockaddr*>(&host), size);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return 2;
  const std::uint64_t cycles = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 0;
  const int port = argc > 3 ? std::atoi(argv[3]) : 0;
  return serve(load_stage_config(argv[1]).spec, cycles, static_cast<std::uint16_t>(port));
}
