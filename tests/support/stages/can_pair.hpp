#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hal/can/can_transport.hpp"

namespace stageid::test {

/// Buses within one process and one thread with a simulated clock. Each end receives what the other sends,
/// and waiting runs the other side instead of passing time. It makes tests of all layers above the kernel
/// exact and fast, and needs no CAN support in the kernel.
class CanPair {
 public:
  explicit CanPair(std::vector<std::string> names)
      : names_(std::move(names)), health_(names_.size()) {}
  CanPair(CanPair&&) = delete;

  CanTransport& host() noexcept { return host_; }
  CanTransport& node() noexcept { return node_; }

  /// Registers the node's work, called whenever the host waits. Time advances by `step_ns` after each call
  /// that sent nothing, until the host's wait ends.
  void when_host_waits(std::function<void()> serve, std::int64_t step_ns = 1'000'000) {
    serve_ = std::move(serve);
    step_ns_ = step_ns;
  }

  std::int64_t now_ns() const noexcept { return now_ns_; }
  void pass_time(std::int64_t ns) noexcept { now_ns_ += ns; }
  void set_state(std::size_t bus, CanBusState state) noexcept {  ///< of both ends
    health_[bus].state = state;
  }

 private:
  class End final : public CanTransport {
   public:
    End(CanPair& pair, End& other) : pair_(pair), other_(other) {}

    std::size_t buses() const noexcept override { return pair_.names_.size(); }
    const std::string& name(std::size_t bus) const noexcept override { return pair_.names_[bus]; }
    std::size_t send(std::span<const CanFrame> frames) noexcept override {
      std::size_t sent = 0;
      for (const CanFrame& frame : frames) {
        CanBusHealth& health = pair_.health_[frame.bus];
        if (health.state >= CanBusState::off) {
          ++health.send_refused;
          continue;
        }
        other_.queue_.push_back(frame);
        ++sent;
      }
      return sent;
    }
    std::size_t receive(std::span<CanFrame> frames) noexcept override {
      const std::size_t count = std::min(frames.size(), queue_.size());
      for (std::size_t i = 0; i < count; ++i) {
        frames[i] = queue_.front();
        frames[i].t_rx_ns = pair_.now_ns_;
        queue_.pop_front();
      }
      return count;
    }
    void wait(std::int64_t until_ns) noexcept override {
      if (this != &pair_.host_ || pair_.serving_ || !pair_.serve_) return;
      while (queue_.empty() && pair_.now_ns_ < until_ns) {
        pair_.serving_ = true;
        pair_.serve_();
        pair_.serving_ = false;
        if (queue_.empty()) pair_.now_ns_ = std::min(until_ns, pair_.now_ns_ + pair_.step_ns_);
      }
    }
    const CanBusHealth& health(std::size_t bus) const noexcept override {
      return pair_.health_[bus];
    }
    std::int64_t now_ns() const noexcept override { return pair_.now_ns_; }

   private:
    CanPair& pair_;
    End& other_;
    std::deque<CanFrame> queue_;
  };

  std::vector<std::string> names_;
  std::vector<CanBusHealth> health_;
  std::int64_t now_ns_ = 1'000'000'000;
  std::int64_t step_ns_ = 1'000'000;
  std::function<void()> serve_;
  bool serving_ = false;
  End host_{*this, node_};
  End node_{*this, host_};
};

}  // namespace stageid::test
