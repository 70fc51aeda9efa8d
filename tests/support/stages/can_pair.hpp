#pragma once

#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/can/can_transport.hpp"

namespace stageid::test {

/// Buses within one process and one thread with a simulated clock. Each end receives what the other sends,
/// and waiting runs the other side instead of passing time. It makes tests of all layers above the kernel
/// exact and fast, and needs no CAN support in the kernel.
class CanPair {
 public:
  explicit CanPair(std::vector<std::string> names);
  ~CanPair();

  CanTransport& host() noexcept;
  CanTransport& node() noexcept;

  /// Registers the node's work, called whenever the host waits. Time advances by `step_ns` after each call
  /// that sent nothing, until the host's wait ends.
  void when_host_waits(std::function<void()> serve, std::int64_t step_ns = 1'000'000);
  std::int64_t now_ns() const noexcept;
  void pass_time(std::int64_t ns) noexcept;
  void set_state(std::size_t bus, CanBusState state) noexcept;  ///< of both ends

 private:
  class End;
  struct Wire;
  std::unique_ptr<Wire> wire_;
  std::unique_ptr<End> host_;
  std::unique_ptr<End> node_;
};

}  // namespace stageid::test
