#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/can/can_encoding.hpp"
#include "hal/can/can_layout.hpp"
#include "hal/can/can_player.hpp"
#include "hal/can/can_transport.hpp"
#include "hal/node/stage_node.hpp"
#include "hal/stage/pacer.hpp"

namespace stageid {

/// Serves a StageNode over CAN: the node's end of docs/can-protocol.md.
///
/// Streaming: the complete setpoint frames of a sample newer than the last one advance the stage by one
/// sample. They are answered with the measurement of the same sequence. A duplicate setpoint is answered again
/// without advancing. Skipped setpoints are counted as gaps and advance once only. Frames that are damaged,
/// of another length or of another run are counted and ignored.
///
/// From start or arm on, the stage belongs to the host that received the key. Commands of other hosts are
/// refused and change nothing, except a quick stop, which any host may send.
class CanNode {
 public:
  /// @param pace resident experiments: 0 as fast as possible, otherwise stage seconds per second.
  /// @param own_clock streaming: a setpoint waits for the next sample instant of this computer's clock
  CanNode(StageNode& stage, const CanLayout& layout, CanTransport& transport, double pace = 0.0,
          bool own_clock = false);

  /// Waits for work until `until_ns` of the transport's clock, processes a batch of received frames, and runs
  /// the stage's watchdog even if more frames are pending. Must be called at least every millisecond.
  void serve(std::int64_t until_ns);

  /// Number of frames that were damaged or of another run, since construction.
  std::uint32_t rejected() const noexcept { return rejected_; }

 private:
  void handle(const CanFrame& frame);
  void take_setpoint(const CanFrame& frame, std::size_t number);
  void take_complete_setpoint(std::uint16_t sequence);
  void obey(const CanCommand& command);
  std::string admit(const CanCommand& command) const;
  std::string execute(const CanCommand& command);
  std::string start(const CanCommand& command);
  std::string request(SupervisorCommand command);
  std::string arm(const CanCommand& command);
  void take_over(const CanCommand& command);
  void make_answer(std::uint16_t sequence, std::uint64_t valid);
  void put_answer();
  void put_state(const CanCommand* answered, CanAnswer answer, const std::string& text);
  void announce();
  void flush();

  StageNode& stage_;
  CanLayout layout_;
  CanTransport& transport_;
  CanPlayer player_;
  Pacer ticks_;
  bool own_clock_;

  std::vector<CanFrame> inbox_;
  std::vector<CanFrame> outbox_;
  std::vector<CanFrame> answer_;  // the last measurement, for a duplicate setpoint
  std::vector<double> command_;
  std::vector<double> y_;
  std::vector<double> given_;  // y_ with NaN where there is no measurement

  std::uint32_t boot_;
  std::uint32_t session_ = 0;        // key of the last run begun by this front end
  CanCommand begun_by_;              // the start or arm that began it
  std::uint32_t trace_session_ = 0;  // of the run in the trace memory
  std::uint16_t last_sequence_ = 0;
  std::uint16_t pending_sequence_ = 0;
  std::uint64_t pending_frames_ = 0;  // bit k: setpoint frame k was received
  std::uint32_t gaps_ = 0;
  std::uint32_t repeated_ = 0;
  std::uint32_t rejected_ = 0;
  NodeState announced_ = NodeState::not_ready;
  std::int64_t next_heartbeat_ns_ = 0;
  bool state_asked_ = false;
};

}  // namespace stageid
