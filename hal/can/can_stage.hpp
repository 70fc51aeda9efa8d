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
#include "hal/stage/sample_clock.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

struct CanHostOptions {
  double pace = 0.0;         ///< 0: virtual time, as fast as the node answers; 1: wall clock
  bool reset_fault = false;  ///< clears a fault of the node at the first start()
  /// Called while a command waits for its answer; true ends the wait with StageError.
  std::function<bool()> interrupted = {};
};

/// Counts of irregular events over all runs.
struct CanCounts {
  std::uint64_t repeats = 0;    ///< setpoints sent again (virtual time only)
  std::uint64_t old = 0;        ///< answers to earlier samples: late, duplicate or out of order
  std::uint64_t damaged = 0;    ///< CRC or length
  std::uint64_t foreign = 0;    ///< of another run or host, or with an unknown identifier
  std::uint64_t saturated = 0;  ///< values out of range
};

/// A stage behind CAN FD, streaming: per sample, one setpoint frame per bus and the measurement of the same
/// sequence back. Protocol: docs/can-protocol.md.
///
/// The answer is awaited until the deadline, or for reply_timeout_s if there is none. The outcome is `ok` if all
/// channels arrived. Otherwise it is `corrupt` if a frame was damaged, `incomplete` if some channels arrived, and
/// `stale` if none did. Older answers are counted and discarded. In virtual time the setpoint is repeated up to
/// three times, because nothing moves while the host waits; on the wall clock it is never repeated.
/// Measurements on the wall clock are stamped by the node's time, or by their arrival if the node has no clock.
/// With CanSpec::node_clock, the host does not wait for instants of its own: the instant of a sample is the node's,
/// converted to the clock of the host with the offset and drift that follow from the stamps.
/// peer_status.hpp defines the meaning of the node's and the bus's states. A command that cannot be encoded is a
/// fault.
class CanStage final : public CyclicStage {
 public:
  /// @throws std::invalid_argument if the spec does not fit the stage, or a bus cannot carry it.
  CanStage(StageInfo info, const CanSpec& spec, std::unique_ptr<CanTransport> transport,
           const CanHostOptions& options);

  /// Checks that a compatible node answers; start() does this too.
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
  void stamp(Inputs& inputs) noexcept;
  PeerStatus judge(const Inputs& inputs) noexcept;
  PeerStatus node_status() const noexcept;
  std::uint64_t all_sensors() const noexcept { return all_bits(fresh_.size()); }
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
  bool not_carried_ = false;  // a command could not be encoded
  std::uint64_t states_before_ = 0;
  NodeState measured_in_ = NodeState::not_ready;
  bool out_of_range_ = false;
  bool conflict_ = false;          // two different answers to one sample
  std::uint64_t samples_bad_ = 0;  // of this run
  PeerStatus status_ = PeerStatus::good;
  // The status that stopped the run; it may be good again while the excitation is ramped down.
  PeerStatus stopped_by_ = PeerStatus::good;
  std::int64_t arrival_ns_ = 0;   // of the last measurement's first frame
  std::uint16_t node_us_ = 0;     // its time by the node, modulo 2^16
  std::int64_t stamped_ns_ = 0;   // arrival of the last one that was stamped
  std::uint16_t stamped_us_ = 0;  // its time by the node
  std::int64_t node_ns_ = 0;  // the same without modulo; its lowest 16 bits in us are the node's
  enum class NodeTime : std::uint8_t { unknown, none, runs } node_time_ = NodeTime::unknown;
  SampleClock host_of_node_;     // arrival over the node's time
  std::int64_t instant_ns_ = 0;  // of the last sample, if the node sets the pace
  CanCounts counts_;
  std::string trouble_at_stop_;
  std::vector<CanFrame> outbox_;
  std::vector<CanFrame> inbox_;
  std::vector<CanFrame> answers_;  // the last of each sensor frame
  std::vector<double> fresh_;      // NaN: not received
  std::vector<double> decoded_;    // of one frame
};

}  // namespace stageid
