#include "hal/can/can_resident_stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/can/can_player.hpp"
#include "hal/stage/peer_status.hpp"

namespace stageid {
namespace {

constexpr std::uint32_t kUploadWindow = 96;  // chunks per query for missing ones
constexpr std::uint32_t kDownloadWindow = 128;
constexpr std::int64_t kPause_ns = 1'000'000;
constexpr std::int64_t kSilence_ns = 50'000'000;  // then the rest of the window is requested again
constexpr std::int64_t kFull_ns = 1'000'000'000;  // then the rest is sent with the next window
constexpr int kLargestTries = 20;                 // windows without any progress

}  // namespace

CanResidentStage::CanResidentStage(StageInfo info, const CanSpec& spec,
                                   std::unique_ptr<CanTransport> transport,
                                   const CanHostOptions& options)
    : info_(std::move(info)),
      layout_(can_layout(spec, info_)),
      transport_(std::move(transport)),
      link_(*transport_, layout_.fingerprint, options.interrupted),
      reset_fault_(options.reset_fault),
      token_(static_cast<std::uint8_t>(link_.host())) {
  require(info_.actuators.size() <= 64, "can: resident experiments support at most 64 actuators");
  info_.backend = "can";
  info_.clock = Clock::virtual_time;  // this side does not wait for samples
}

std::uint64_t CanResidentStage::depth_samples() const noexcept {
  return CanPlayer::depth_bytes() / can_trace_row_bytes(info_);
}

void CanResidentStage::connect() {
  if (greeted_) return;
  static_cast<void>(link_.greet(std::exchange(reset_fault_, false)));
  greeted_ = true;
}

/// Stores the columns that are not zero, as float32.
void CanResidentStage::pack(const Waveforms& waveforms) {
  const Eigen::MatrixXd& samples = waveforms.samples;
  require(samples.cols() == static_cast<Eigen::Index>(info_.actuators.size()) &&
              samples.rows() > 0 && samples.allFinite() && waveforms.periods >= 1 &&
              waveforms.transient_periods >= 0,
          "can: waveforms must be finite, with at least one sample, one period and one column per "
          "actuator");
  std::vector<Eigen::Index> columns;
  mask_ = 0;
  for (Eigen::Index column = 0; column < samples.cols(); ++column) {
    if (samples.col(column).isZero(0.0)) continue;
    columns.push_back(column);
    mask_ |= std::uint64_t{1} << column;
  }
  require(!columns.empty(), "can: all waveforms are zero; excite at least one actuator");
  period_samples_ = static_cast<std::uint32_t>(samples.rows());
  samples_ = std::uint64_t{period_samples_} *
             static_cast<std::uint64_t>(waveforms.periods + waveforms.transient_periods);
  require(samples_ <= depth_samples(),
          "can: {} samples per run, but the node records at most {}; lower the number of periods",
          samples_, depth_samples());
  waveform_.clear();
  for (Eigen::Index n = 0; n < samples.rows(); ++n)
    for (const Eigen::Index column : columns) append_can_float(waveform_, samples(n, column));
  digest_ = can_digest(waveform_);
}

void CanResidentStage::send_missing(const std::vector<std::uint32_t>& chunks) {
  for (const std::uint32_t index : chunks) {
    const CanFrame frame = encode_can_part(kCanUploadId, token_, index, waveform_);
    // A full queue means that the bus is slower than the sender.
    const std::int64_t until_ns = transport_->now_ns() + kFull_ns;
    while (transport_->send({&frame, 1}) == 0 && worst_bus(*transport_).state < CanBusState::off) {
      if (transport_->now_ns() >= until_ns || link_.interrupted()) return;
      transport_->wait(transport_->now_ns() + kPause_ns);
    }
  }
}

void CanResidentStage::send_all() {
  const auto total = static_cast<std::uint32_t>(can_chunks(waveform_.size()));
  std::uint32_t first = 0;
  for (int tries = 0; tries < kLargestTries;) {
    CanMissing missing;
    link_.command({CanCommandCode::missing}, [&](const CanFrame& frame) {
      CanMissing said;
      if (decode_can_missing(frame, said) && said.token == token_) missing = said;
    });
    if (missing.token == token_ && missing.first >= total) return;
    tries = missing.token == token_ && missing.first > first ? 0 : tries + 1;
    if (missing.token != token_) continue;  // the answer itself was lost
    first = missing.first;
    std::vector<std::uint32_t> chunks;
    for (std::uint32_t i = 0;
         i < kCanMissingBits && first + i < total && chunks.size() < kUploadWindow; ++i)
      if ((missing.received[i / 8] >> (i % 8) & 1U) == 0) chunks.push_back(first + i);
    send_missing(chunks);
  }
  throw StageError(fmt::format(
      "can: {}: the upload stopped at chunk {} of {}; repeat it when the bus works again",
      transport_->name(0), first, total));
}

JobProgress CanResidentStage::upload(const Waveforms& waveforms) {
  pack(waveforms);
  connect();
  link_.command({.code = CanCommandCode::upload, .a = mask_, .b = digest_, .c = period_samples_});
  send_all();
  std::vector<std::uint8_t> back(waveform_.size());
  std::size_t chunks = 0;
  require<StageError>(
      read(CanMemory::waveform, back, chunks) && back == waveform_,
      "can: {}: the waveform in the node differs from the one sent; upload it again",
      transport_->name(0));
  trace_.clear();
  trace_chunks_ = 0;
  rows_given_ = 0;
  return {JobStatus::done, waveform_.size(), waveform_.size(), ""};
}

JobProgress CanResidentStage::arm(const Trigger& trigger) {
  connect();
  const double ramp = std::round(trigger.ramp_s * info_.sample_rate_hz);
  require(ramp >= 0.0 && ramp < 1e9, "can: ramp_s must be 0 or more; got {}", trigger.ramp_s);
  link_.command({.code = CanCommandCode::arm,
                 .a = trigger.run_seed,
                 .b = samples_,
                 .c = static_cast<std::uint32_t>(ramp),
                 .d = static_cast<std::uint32_t>(digest_)});
  while (transport_->now_ns() < trigger.t_start_ns) transport_->wait(trigger.t_start_ns);
  link_.command({CanCommandCode::trigger});
  return poll();
}

JobProgress CanResidentStage::poll() {
  const CanState node = link_.command({CanCommandCode::hello});
  JobProgress progress;
  progress.done = std::min(node.sample, samples_);
  progress.total = samples_;
  if (node.run != can_run(link_.session())) {
    progress.status = JobStatus::failed;
    progress.outcome = Outcome::fault;
    progress.message = meaning(PeerStatus::held).words;
    return progress;
  }
  if (node.resident == CanResident::playing || node.resident == CanResident::armed) return progress;
  progress.status = JobStatus::done;
  if (node.resident == CanResident::done) return progress;
  progress.status = JobStatus::failed;
  const PeerReport report{.state = node.state, .cause = node.cause, .valid = 1, .all = 1};
  progress.outcome = std::max(meaning(judge(report)).outcome, Outcome::fault);
  progress.message = fmt::format("the node stopped in state {}{}{}", to_string(node.state),
                                 link_.text().empty() ? "" : ": ", link_.text());
  return progress;
}

/// Fetches `bytes.size()` bytes, starting at chunk `chunks_done`. @returns false if some are missing.
bool CanResidentStage::read(CanMemory memory, std::vector<std::uint8_t>& bytes,
                            std::size_t& chunks_done) {
  const std::size_t total = can_chunks(bytes.size());
  std::vector<bool> have(total, false);
  for (std::size_t i = 0; i < chunks_done; ++i) have[i] = true;
  std::int64_t heard_ns = 0;
  const CanLink::Other take = [&](const CanFrame& frame) {
    CanChunk chunk;
    if (frame.id != kCanDownloadId || !decode_can_chunk(frame, chunk) || chunk.token != token_ ||
        !take_can_part(chunk, bytes))
      return;
    if (!have[chunk.index]) heard_ns = transport_->now_ns();  // duplicates are not progress
    have[chunk.index] = true;
  };
  std::vector<CanFrame> inbox(64);
  for (int tries = 0; chunks_done < total && tries < kLargestTries; ++tries) {
    const std::size_t before = chunks_done;
    const std::size_t end = std::min<std::size_t>(total, chunks_done + kDownloadWindow);
    link_.command({.code = CanCommandCode::download,
                   .a = chunks_done,
                   .b = static_cast<std::uint64_t>(memory),
                   .c = static_cast<std::uint32_t>(end - chunks_done)},
                  take);
    heard_ns = transport_->now_ns();
    const auto advance = [&] {
      while (chunks_done < total && have[chunks_done]) ++chunks_done;
    };
    for (advance(); chunks_done < end && transport_->now_ns() < heard_ns + kSilence_ns; advance()) {
      const std::size_t count = transport_->receive(inbox);
      for (std::size_t i = 0; i < count; ++i)
        if (!link_.take(inbox[i])) take(inbox[i]);
      if (count == 0) transport_->wait(heard_ns + kSilence_ns);
    }
    if (chunks_done > before) tries = -1;
  }
  return chunks_done == total;
}

JobProgress CanResidentStage::download(const TraceSink& sink) {
  const CanState node = link_.command({CanCommandCode::hello});
  const std::uint64_t rows = std::min(node.sample, samples_);
  const std::size_t row_bytes = can_trace_row_bytes(info_);
  trace_.resize(rows * row_bytes);
  const bool complete = read(CanMemory::trace, trace_, trace_chunks_);
  require<StageError>(
      complete,
      "can: {}: the download stopped after {} of {} chunks; repeat it when the bus works again",
      transport_->name(0), trace_chunks_, can_chunks(trace_.size()));
  const std::size_t columns = info_.actuators.size() + info_.sensors.size();
  std::vector<double> values;
  std::vector<Outcome> outcomes;
  constexpr std::uint64_t kRowsAtOnce = 1024;
  while (rows_given_ < rows) {
    const std::uint64_t end = std::min(rows, rows_given_ + kRowsAtOnce);
    values.clear();
    outcomes.clear();
    for (std::uint64_t row = rows_given_; row < end; ++row) {
      const std::size_t at = row * row_bytes;
      for (std::size_t i = 0; i < columns; ++i)
        values.push_back(can_float_at(trace_, at + kCanFloatBytes * i));
      outcomes.push_back(outcome_of_code(trace_[at + kCanFloatBytes * columns]));
    }
    sink(values, outcomes);
    rows_given_ = end;
  }
  return {JobStatus::done, rows, samples_, ""};
}

void CanResidentStage::stop() noexcept {
  if (link_.session() == 0) return;  // the node has begun no run for this host
  static_cast<void>(link_.try_command({CanCommandCode::stop}));
}

}  // namespace stageid
