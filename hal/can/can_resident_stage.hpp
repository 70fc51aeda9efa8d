#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "hal/can/can_layout.hpp"
#include "hal/can/can_link.hpp"
#include "hal/can/can_stage.hpp"
#include "hal/can/can_transport.hpp"
#include "hal/stage/resident_stage.hpp"

namespace stageid {

/// A node behind CAN that plays experiments by itself. Protocol: docs/can-protocol.md.
///
/// Transfers use windows of chunks. Lost chunks are requested and sent again, so transfers also complete on
/// lossy buses. If nothing arrives for a second, they fail with StageError and can be resumed.
class CanResidentStage final : public ResidentStage {
 public:
  /// @throws std::invalid_argument if the spec does not fit the stage.
  CanResidentStage(StageInfo info, const CanSpec& spec, std::unique_ptr<CanTransport> transport,
                   const CanHostOptions& options);

  /// Checks that a compatible node answers; upload() and arm() do this too. @throws StageError
  void connect();

  const StageInfo& info() const noexcept override { return info_; }
  std::uint64_t depth_samples() const noexcept override;
  JobProgress upload(const Waveforms& waveforms) override;
  JobProgress arm(const Trigger& trigger) override;
  JobProgress poll() override;
  JobProgress download(const TraceSink& sink) override;
  void stop() noexcept override;

 private:
  void pack(const Waveforms& waveforms);
  void send_missing(const std::vector<std::uint32_t>& chunks);
  void send_all();
  bool read(CanMemory memory, std::vector<std::uint8_t>& bytes, std::size_t& chunks_done);

  StageInfo info_;
  CanLayout layout_;
  std::unique_ptr<CanTransport> transport_;
  CanLink link_;
  bool reset_fault_;
  bool greeted_ = false;
  std::uint8_t token_;  // of this host's transfers

  std::vector<std::uint8_t> waveform_;  // as transferred
  std::uint64_t mask_ = 0;
  std::uint32_t period_samples_ = 0;
  std::uint64_t samples_ = 0;
  std::uint64_t digest_ = 0;

  std::vector<std::uint8_t> trace_;
  std::size_t trace_chunks_ = 0;  // received chunks
  std::uint64_t rows_given_ = 0;
};

}  // namespace stageid
