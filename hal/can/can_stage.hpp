#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "hal/can/can_layout.hpp"
#include "hal/can/can_link.hpp"
#include "hal/can/can_transport.hpp"
#include "hal/stage/pacer.hpp"
#include "hal/stage/peer_status.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

struct CanHostOptions {
  double pace = 0.0;         ///< 0: virtual time, as fast as the node answers; 1: wall clock
  bool reset_fault = false;  ///< clear a fault of the node at the first start()
  /// Looked at while a command waits for its answer; true ends it with StageError.
  std::function<bool()> interrupted = {};
};

/// What was not as it should be, over all runs.
struct CanCounts {
  std::uint64_t repeats = 0;  ///< setpoints sent again (virtual time only)
  std::uint64_t old = 0;      ///< answers to earlier samples: late, repeated or swapped
  std::uint64_t damaged = 0;  ///< CRC or length
  std::uint64_t foreign =
      0;  ///< of another run or host, or with an identifier that is none of ours
  std::uint64_t saturated = 0;  ///< values that did not fit into their range
};

/// A stage behind CAN FD, streaming: a setpoint frame a sample and bus out, the measurement of the
/// same sequence back. docs/can-protocol.md says what is on the wire.
///
/// The answer is awaited until the deadline, or for reply_timeout_s if there is none. Of what has
/// come by then: everything is ok; some channels incomplete; nothing but damaged frames corrupt;
/// nothing stale. An older answer is counted and thrown away. In virtual time, where nothing moves
/// while the host waits, the setpoint is repeated three times before that; against the wall clock
/// never. What the node says of itself and its bus has the meaning that peer_status.hpp gives it. A command
/// that the wire cannot carry is a fault.
class CanStage final : public CyclicStage {
 public:
  /// @throws std::invalid_argument if the spec does not fit the stage, or a bus cannot carry it.
  CanStage(StageInfo info, const CanSpec& spec, std::unique_ptr<CanTransport> transport,
           const CanHostOptions& options);

  /// Looks whether a node answers that fits, before anything else is done; start() does too.
  /// @throws StageError as start().
  void connect();

  const StageInfo& info() const noexcept override { return info_; }
  /// @throws StageError if no node answers, it refuses, or it runs another stage file.
  void start(std::uint64_t run_seed, Inputs& first) override;
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override;
  void stop() noexcept override;
  std::string trouble() const override;

  const CanCounts& counts() const noexcept { return counts_; }
  const CanState& node() const noexcept { return link_.state(); }

 private:
  void begin_cycle(std::uint16_t sequence) noexcept;
  bool send_setpoints(const Outputs& outputs) noexcept;
  void collect(std::int64_t until_ns) noexcept;
  void take(const CanFrame& frame) noexcept;
  bool complete() const noexcept { return frames_missing_ == 0; }
  bool over() const noexcept;
  std::int64_t reply_deadline_ns(Deadline deadline) const noexcept;
  PeerStatus judge(const Inputs& inputs) noexcept;
  PeerStatus bus_status() const noexcept;
  PeerStatus node_status() const noexcept;
  std::uint64_t all_sensors() const noexcept { return ~std::uint64_t{0} >> (64 - fresh_.size()); }
  void give(Inputs& inputs) const noexcept;

  StageInfo info_;
  CanLayout layout_;
  std::unique_ptr<CanTransport> transport_;
  CanLink link_;
  Pacer pacer_;
  bool wall_;
  bool reset_fault_;
  std::int64_t reply_timeout_ns_;
  std::int64_t period_ns_;

  bool running_ = false;
  std::uint16_t expected_ = 0;
  std::size_t frames_missing_ = 0;
  std::uint64_t frames_seen_ = 0;  // bit k: sensor frame k of this cycle
  bool damaged_in_cycle_ = false;
  bool not_carried_ = false;  // a command that does not fit on the wire
  std::uint64_t states_before_ = 0;
  NodeState measured_in_ = NodeState::not_ready;
  bool out_of_range_ = false;
  bool conflict_ = false;          // two answers to one sample
  std::uint64_t samples_bad_ = 0;  // of this run
  PeerStatus status_ = PeerStatus::good;
  std::int64_t t_rx_ns_ = 0;
  CanConversions conversions_;
  CanCounts counts_;
  std::string trouble_at_stop_;
  std::vector<CanFrame> outbox_;
  std::vector<CanFrame> inbox_;
  std::vector<CanFrame> answers_;  // the last of each sensor frame
  std::vector<double> fresh_;      // NaN: nothing came
  std::vector<double> decoded_;    // of one frame
};

}  // namespace stageid
