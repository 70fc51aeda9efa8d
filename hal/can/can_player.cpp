#include "hal/can/can_player.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

namespace stageid {
namespace {

constexpr std::int64_t kHostSilence_ns = 1'000'000'000;
constexpr int kSamplesAtOnce = 256;  // between two checks of the bus
constexpr std::size_t kChunksAtOnce = 32;
constexpr std::uint32_t kLargestDownload = 256;

bool gives_measurement(Outcome outcome) {
  return outcome != Outcome::fault && outcome != Outcome::limit && outcome != Outcome::bus_off &&
         outcome != Outcome::link_down;
}

}  // namespace

CanPlayer::CanPlayer(StageNode& stage, double pace)
    : stage_(stage),
      pace_(pace),
      r_(stage.info().actuators.size()),
      u_(stage.info().actuators.size()),
      y_(stage.info().sensors.size()) {}

std::string CanPlayer::prepare(const CanCommand& command) {
  if (busy()) return "a resident experiment is running; stop it first";
  token_ = static_cast<std::uint8_t>(command.host);
  if (command.a == mask_ && command.b == digest_ && command.c == period_samples_ &&
      !waveform_.empty())
    return "";
  const auto channels = static_cast<std::size_t>(std::popcount(command.a));
  if (channels == 0 || command.c == 0)
    return "an upload needs at least one sample and one actuator";
  if (r_.size() < 64 && (command.a >> r_.size()) != 0)
    return fmt::format("actuator out of range; the node has {}", r_.size());
  const std::uint64_t bytes = std::uint64_t{command.c} * channels * kCanFloatBytes;
  if (bytes > depth_bytes())
    return fmt::format("waveform of {} bytes exceeds the memory of {} bytes", bytes, depth_bytes());
  mask_ = command.a;
  digest_ = command.b;
  period_samples_ = command.c;
  columns_.clear();
  for (std::size_t i = 0; i < r_.size(); ++i)
    if (((mask_ >> i) & 1U) != 0) columns_.push_back(i);
  waveform_.assign(bytes, 0);
  received_.assign(can_chunks(bytes), false);
  missing_from_ = 0;
  status_ = CanResident::idle;
  return "";
}

bool CanPlayer::take_chunk(const CanChunk& chunk) noexcept {
  // The digest of an armed waveform has been checked already.
  if (busy() || status_ == CanResident::armed) return false;
  if (chunk.token != token_) return false;
  if (!take_can_part(chunk, waveform_)) return false;
  received_[chunk.index] = true;
  while (missing_from_ < received_.size() && received_[missing_from_]) ++missing_from_;
  return true;
}

CanMissing CanPlayer::missing() const noexcept {
  CanMissing missing;
  missing.first = static_cast<std::uint32_t>(missing_from_);
  missing.token = token_;
  for (std::size_t i = 0; i < kCanMissingBits && missing_from_ + i < received_.size(); ++i)
    if (received_[missing_from_ + i])
      missing.received[i / 8] |= static_cast<std::uint8_t>(1U << (i % 8));
  return missing;
}

std::string CanPlayer::arm(const CanCommand& command) {
  if (busy()) return "a resident experiment is running; stop it first";
  if (waveform_.empty() || missing_from_ < received_.size())
    return "the waveform is incomplete; upload it first";
  if (can_digest(waveform_) != digest_ || static_cast<std::uint32_t>(digest_) != command.d)
    return "the memory contains a different waveform; upload it again";
  const std::size_t row_bytes = can_trace_row_bytes(stage_.info());
  if (command.b == 0 || command.b > depth_bytes() / row_bytes)
    return fmt::format("{} samples exceed the trace memory of {}", command.b,
                       depth_bytes() / row_bytes);
  const SupervisorReply reply = stage_.request(SupervisorCommand::enable);
  if (!reply.accepted) return reply.message;
  if (stage_.session() == 0) static_cast<void>(stage_.reserve());
  seed_ = command.a;
  samples_ = command.b;
  ramp_samples_ = command.c;
  trace_.clear();
  trace_.reserve(samples_ * row_bytes);
  reserved_ = true;
  status_ = CanResident::armed;
  return "";
}

std::string CanPlayer::trigger(const CanCommand& command, std::int64_t now_ns) {
  const bool again = command.sequence == trigger_sequence_ &&
                     (busy() || status_ == CanResident::done || status_ == CanResident::failed);
  if (again) return "";
  if (status_ != CanResident::armed) return "not armed; arm it first";
  Inputs first;
  first.y = y_;
  try {
    static_cast<void>(stage_.begin_run(seed_, now_ns, first, stage_.session()));
  } catch (const StageError& error) {
    return error.what();
  }
  trigger_sequence_ = command.sequence;
  played_ = 0;
  began_ns_ = now_ns;
  outcome_ = Outcome::ok;
  status_ = CanResident::playing;
  return "";
}

std::string CanPlayer::begin_download(const CanCommand& command) {
  const auto memory = static_cast<CanMemory>(command.b);
  if (command.b > static_cast<std::uint64_t>(CanMemory::trace)) return "unknown memory";
  const std::size_t chunks =
      can_chunks(memory == CanMemory::trace ? trace_.size() : waveform_.size());
  if (memory == CanMemory::trace && busy()) return "the trace is still being recorded";
  if (command.a >= chunks)
    return fmt::format("chunk {} is out of range; there are {}", command.a, chunks);
  token_ = static_cast<std::uint8_t>(command.host);
  download_of_ = memory;
  download_next_ = command.a;
  download_end_ = std::min(chunks, download_next_ + std::min(command.c, kLargestDownload));
  return "";
}

void CanPlayer::work(std::int64_t now_ns, CanTransport& transport) {
  send_chunks(transport);
  const bool silent = now_ns - last_heard_ns_ > kHostSilence_ns;
  if (reserved_ && !busy() && silent) {
    if (status_ == CanResident::armed)
      static_cast<void>(stage_.request(SupervisorCommand::disable));
    abandon();
  }
  if (!busy()) return;
  if (stage_.state() != NodeState::measuring) {  // quick stop, panel or watchdog
    finish(CanResident::failed);
    return;
  }
  if (silent) {
    stage_.fail(FaultCause::watchdog);
    finish(CanResident::failed);
    return;
  }
  const double due = pace_ > 0.0 ? 1e-9 * static_cast<double>(now_ns - began_ns_) *
                                       stage_.info().sample_rate_hz * pace_
                                 : std::numeric_limits<double>::infinity();
  for (int i = 0; i < kSamplesAtOnce && busy() && static_cast<double>(played_) < due; ++i)
    play_sample(now_ns);
}

void CanPlayer::play_sample(std::int64_t now_ns) {
  const std::uint64_t past = played_ < samples_ ? 0 : played_ - samples_ + 1;
  const double gain =
      static_cast<double>(ramp_samples_ + 1 - past) / static_cast<double>(ramp_samples_ + 1);
  const std::size_t row = static_cast<std::size_t>(played_ % period_samples_) * columns_.size();
  for (std::size_t k = 0; k < columns_.size(); ++k)
    r_[columns_[k]] = gain * can_float_at(waveform_, kCanFloatBytes * (row + k));
  measured_ = y_;  // y[n], from which u[n] is computed
  Inputs inputs;
  inputs.y = y_;
  const Outcome next = stage_.advance_excited(now_ns, r_, u_, inputs);
  if (played_ < samples_) {
    for (const std::vector<double>* values : {&u_, &measured_})
      for (const double value : *values) append_can_float(trace_, value);
    append_can_word(trace_, static_cast<std::uint32_t>(outcome_));
  }
  outcome_ = next;
  ++played_;
  if (!gives_measurement(next)) {
    finish(CanResident::failed);
  } else if (played_ >= samples_ + ramp_samples_) {
    stage_.end_run(true);
    finish(CanResident::done);
  }
}

void CanPlayer::finish(CanResident status) {
  std::fill(r_.begin(), r_.end(), 0.0);
  status_ = status;
}

void CanPlayer::abandon() {
  if (busy()) status_ = CanResident::failed;
  if (status_ == CanResident::armed) status_ = CanResident::idle;
  if (std::exchange(reserved_, false)) stage_.release();
  download_next_ = download_end_ = 0;
}

// Flow control by the bus's send queue: the rest is sent by the next call.
void CanPlayer::send_chunks(CanTransport& transport) {
  const std::vector<std::uint8_t>& memory = download_of_ == CanMemory::trace ? trace_ : waveform_;
  for (std::size_t i = 0; i < kChunksAtOnce && download_next_ < download_end_; ++i) {
    const CanFrame frame = encode_can_part(kCanDownloadId, token_, download_next_, memory);
    if (transport.send({&frame, 1}) == 0) return;
    ++download_next_;
  }
}

}  // namespace stageid
