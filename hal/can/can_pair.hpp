#pragma once

#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/can/can_transport.hpp"

namespace stageid {

/// Buses within one process and one thread, with a clock of their own: what one end sends, the
/// other receives, and waiting lets the other side work instead of time pass. For tests of
/// everything above the kernel: exact, without a kernel that has CAN, in no time.
class CanPair {
 public:
  explicit CanPair(std::vector<std::string> names);
  ~CanPair();

  CanTransport& host() noexcept;
  CanTransport& node() noexcept;

  /// Called whenever the host waits: let the node work. Time goes on by `step_ns` after each call
  /// that sent nothing, until the host's time is over.
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

}  // namespace stageid
