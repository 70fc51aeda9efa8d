#include "tests/support/stages/can_pair.hpp"

#include <algorithm>
#include <utility>

namespace stageid::test {

struct CanPair::Wire {
  std::vector<std::string> names;
  std::vector<CanBusHealth> health;
  std::int64_t now_ns = 1'000'000'000;
  std::int64_t step_ns = 1'000'000;
  std::function<void()> serve;
  bool serving = false;
};

class CanPair::End final : public CanTransport {
 public:
  End(Wire& wire, bool is_host) : wire_(wire), is_host_(is_host) {}
  void connect(End& other) noexcept { other_ = &other; }

  std::size_t buses() const noexcept override { return wire_.names.size(); }
  const std::string& name(std::size_t bus) const noexcept override { return wire_.names[bus]; }

  std::size_t send(std::span<const CanFrame> frames) noexcept override {
    std::size_t sent = 0;
    for (const CanFrame& frame : frames) {
      CanBusHealth& health = wire_.health[frame.bus];
      if (health.state >= CanBusState::off) {
        ++health.send_refused;
        continue;
      }
      other_->queue_.push_back(frame);
      ++sent;
    }
    return sent;
  }

  std::size_t receive(std::span<CanFrame> frames) noexcept override {
    const std::size_t count = std::min(frames.size(), queue_.size());
    for (std::size_t i = 0; i < count; ++i) {
      frames[i] = queue_.front();
      frames[i].t_rx_ns = wire_.now_ns;
      queue_.pop_front();
    }
    return count;
  }

  void wait(std::int64_t until_ns) noexcept override {
    if (!is_host_ || wire_.serving || !wire_.serve) return;
    while (queue_.empty() && wire_.now_ns < until_ns) {
      wire_.serving = true;
      wire_.serve();
      wire_.serving = false;
      if (queue_.empty()) wire_.now_ns = std::min(until_ns, wire_.now_ns + wire_.step_ns);
    }
  }

  const CanBusHealth& health(std::size_t bus) const noexcept override { return wire_.health[bus]; }
  std::int64_t now_ns() const noexcept override { return wire_.now_ns; }

 private:
  Wire& wire_;
  End* other_ = nullptr;
  bool is_host_;
  std::deque<CanFrame> queue_;
};

CanPair::CanPair(std::vector<std::string> names) : wire_(std::make_unique<Wire>()) {
  wire_->health.resize(names.size());
  wire_->names = std::move(names);
  host_ = std::make_unique<End>(*wire_, true);
  node_ = std::make_unique<End>(*wire_, false);
  host_->connect(*node_);
  node_->connect(*host_);
}

CanPair::~CanPair() = default;

CanTransport& CanPair::host() noexcept { return *host_; }
CanTransport& CanPair::node() noexcept { return *node_; }

void CanPair::when_host_waits(std::function<void()> serve, std::int64_t step_ns) {
  wire_->serve = std::move(serve);
  wire_->step_ns = step_ns;
}

std::int64_t CanPair::now_ns() const noexcept { return wire_->now_ns; }
void CanPair::pass_time(std::int64_t ns) noexcept { wire_->now_ns += ns; }
void CanPair::set_state(std::size_t bus, CanBusState state) noexcept {
  wire_->health[bus].state = state;
}

}  // namespace stageid::test
