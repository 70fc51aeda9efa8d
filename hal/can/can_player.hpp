#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/can/can_encoding.hpp"
#include "hal/can/can_transport.hpp"
#include "hal/node/stage_node.hpp"

namespace stageid {

/// The node's side of resident experiments: waveform memory, playback in the node's own closed loop, trace
/// memory, and transfers.
///
/// Waveform: one period, samples x excited actuators, float32, row by row. Trace: one row per sample,
/// u[n] and y[n] of all channels as float32 and the Outcome of y[n] as uint32. Functions that return a text
/// return the reason of a refusal; empty: done.
class CanPlayer {
 public:
  /// @param pace 0: as fast as possible, otherwise stage seconds per second of wall clock.
  CanPlayer(StageNode& stage, double pace);

  /// upload: a mask of actuators, b digest, c samples. Repeating the same command keeps the received chunks.
  std::string prepare(const CanCommand& command);
  /// @returns false if the chunk belongs to no upload.
  bool take_chunk(const CanChunk& chunk) noexcept;
  CanMissing missing() const noexcept;

  /// arm: a run seed, b samples to record, c samples of the ramp after them, d low digest.
  std::string arm(const CanCommand& command);
  std::string trigger(const CanCommand& command, std::int64_t now_ns);
  /// download: a first chunk, b CanMemory, c chunks.
  std::string begin_download(const CanCommand& command);

  /// Plays the samples that are due and sends requested chunks.
  void work(std::int64_t now_ns, CanTransport& transport);
  /// A host that is silent for a second is considered dead: the run ends, and the stage is no longer reserved.
  void host_was_heard(std::int64_t now_ns) noexcept { last_heard_ns_ = now_ns; }
  void abandon();

  bool busy() const noexcept { return status_ == CanResident::playing; }
  CanResident status() const noexcept { return status_; }

  static std::uint64_t depth_bytes() noexcept { return std::uint64_t{256} << 20; }

 private:
  void play_sample(std::int64_t now_ns);
  void finish(CanResident status);
  void send_chunks(CanTransport& transport);

  StageNode& stage_;
  double pace_;
  CanResident status_ = CanResident::idle;

  std::vector<std::uint8_t> waveform_;
  std::vector<bool> received_;
  std::size_t missing_from_ = 0;  // all earlier chunks were received
  std::vector<std::size_t> columns_;
  std::uint64_t mask_ = 0;
  std::uint64_t digest_ = 0;
  std::uint32_t period_samples_ = 0;

  std::uint64_t seed_ = 0;
  std::uint64_t samples_ = 0;
  std::uint32_t ramp_samples_ = 0;
  std::uint64_t played_ = 0;
  std::uint16_t trigger_sequence_ = 0;
  std::int64_t began_ns_ = 0;
  std::int64_t last_heard_ns_ = 0;
  bool reserved_ = false;  // from arm until the host ends it, also while it downloads the trace
  Outcome outcome_ = Outcome::ok;
  std::vector<double> r_;
  std::vector<double> u_;
  std::vector<double> y_;
  std::vector<double> measured_;

  std::vector<std::uint8_t> trace_;
  CanMemory download_of_ = CanMemory::waveform;
  std::size_t download_next_ = 0;
  std::size_t download_end_ = 0;
  std::uint8_t token_ = 0;
};

}  // namespace stageid
