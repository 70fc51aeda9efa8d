#include "hal/can/can_node.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "excitation/words/require.hpp"
#include "hal/stage/peer_status.hpp"

namespace stageid {
namespace {

constexpr auto kHeartbeat_ns = static_cast<std::int64_t>(1e9 / kCanHeartbeatRate_hz);

std::uint16_t microseconds(std::int64_t now_ns) {
  return static_cast<std::uint16_t>(now_ns / 1000);
}

std::int16_t distance(std::uint16_t sequence, std::uint16_t from) {
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(sequence - from));
}

}  // namespace

CanNode::CanNode(StageNode& stage, const CanLayout& layout, CanTransport& transport, double pace,
                 bool own_clock)
    : stage_(stage),
      layout_(layout),
      transport_(transport),
      player_(stage, pace),
      ticks_(stage.info().sample_rate_hz, 1.0),
      own_clock_(own_clock),
      boot_(std::random_device()() | 1U) {
  require(layout_.setpoints.size() <= 64, "can: a node supports at most 64 setpoint frames");
  inbox_.resize(kCanInboxFrames);
  command_.assign(stage.info().actuators.size(), 0.0);
  y_.assign(stage.info().sensors.size(), 0.0);
  given_ = y_;
}

void CanNode::serve(std::int64_t until_ns) {
  if (!player_.busy() && until_ns > transport_.now_ns()) transport_.wait(until_ns);
  // If this node is delayed after this instant, the host may have sent meanwhile: it is not silent.
  const std::int64_t now_ns = transport_.now_ns();
  const std::size_t count = transport_.receive(inbox_);
  // First, because a bus that is off takes precedence over received commands.
  if (worst_bus(transport_).state >= CanBusState::off && stage_.state() == NodeState::measuring)
    stage_.fail(FaultCause::bus_off);
  for (std::size_t i = 0; i < count; ++i) handle(inbox_[i]);
  player_.work(now_ns, transport_);
  stage_.tick(now_ns);
  announce();
  flush();
}

void CanNode::handle(const CanFrame& frame) {
  if (frame.id >= kCanSetpointId && frame.id < kCanSetpointId + layout_.setpoints.size()) {
    take_setpoint(frame, frame.id - std::size_t{kCanSetpointId});
  } else if (frame.id == kCanCommandId) {
    CanCommand command;
    if (decode_can_command(frame, command)) {
      obey(command);
    } else {
      ++rejected_;
    }
  } else if (frame.id == kCanUploadId) {
    CanChunk chunk;
    if (!decode_can_chunk(frame, chunk) || !player_.take_chunk(chunk)) ++rejected_;
  } else {
    ++rejected_;
  }
}

void CanNode::take_setpoint(const CanFrame& frame, std::size_t number) {
  const CanValueFrame& layout = layout_.setpoints[number];
  CanHeader header;
  if (!open_can_frame(frame, layout.payload_bytes(), header) || frame.bus != layout.bus) {
    ++rejected_;
    return;
  }
  // The sender of an ended run is still told why it ended.
  const std::uint32_t holder = stage_.session();
  if (session_ == 0 || (holder != 0 && holder != session_) || header.run != can_run(session_) ||
      header.detail != can_tag(session_) || player_.busy()) {
    ++rejected_;
    state_asked_ = true;
    return;
  }
  if (distance(header.sequence, last_sequence_) <= 0) {
    ++repeated_;
    if (header.sequence == last_sequence_ && number + 1 == layout_.setpoints.size()) put_answer();
    return;
  }
  if (pending_frames_ != 0 && distance(header.sequence, pending_sequence_) < 0) return;
  if (header.sequence != pending_sequence_)
    pending_frames_ = 0;  // the older sample remains incomplete
  pending_sequence_ = header.sequence;
  if (!decode_can_values(layout, layout_.actuator_scale, frame, header, command_)) return;
  pending_frames_ |= std::uint64_t{1} << number;
  if (pending_frames_ == all_bits(layout_.setpoints.size()))
    take_complete_setpoint(header.sequence);
}

void CanNode::take_complete_setpoint(std::uint16_t sequence) {
  pending_frames_ = 0;
  gaps_ += static_cast<std::uint32_t>(distance(sequence, last_sequence_) - 1);
  last_sequence_ = sequence;
  if (!std::all_of(command_.begin(), command_.end(), [](double u) { return std::isfinite(u); })) {
    stage_.fail(FaultCause::not_finite);  // "no value" is not a valid setpoint
    state_asked_ = true;
    return;
  }
  if (own_clock_)
    while (ticks_.wait().late) {  // keep the phase
    }
  Inputs inputs;
  inputs.y = y_;
  const Outcome outcome = stage_.advance(transport_.now_ns(), command_, inputs);
  announce();
  if (outcome == Outcome::fault) {
    state_asked_ = true;
    return;
  }
  make_answer(sequence, outcome == Outcome::stale ? 0 : inputs.valid);
  put_answer();
  flush();
}

void CanNode::make_answer(std::uint16_t sequence, std::uint64_t valid) {
  for (std::size_t i = 0; i < y_.size(); ++i)
    given_[i] = ((valid >> i) & 1U) != 0 ? y_[i] : std::numeric_limits<double>::quiet_NaN();
  const CanHeader header{sequence, static_cast<std::uint8_t>(stage_.state()), can_run(session_),
                         microseconds(transport_.now_ns())};
  answer_.resize(layout_.sensors.size());
  for (std::size_t i = 0; i < answer_.size(); ++i)
    encode_can_values(layout_.sensors[i], layout_.sensor_scale, given_, header, answer_[i]);
}

void CanNode::put_answer() { outbox_.insert(outbox_.end(), answer_.begin(), answer_.end()); }

/// @returns why the sender may not give this command; empty: permitted. Changes nothing.
std::string CanNode::admit(const CanCommand& command) const {
  using Code = CanCommandCode;
  if (command.version != kCanProtocolVersion)
    return fmt::format("{} ({}; expected {}); update the older program",
                       meaning(PeerStatus::other_version).words, kCanProtocolVersion,
                       command.version);
  if (command.code == Code::hello || command.code == Code::missing ||
      command.code == Code::quick_stop || command.code == Code::reset_fault)
    return "";
  if (command.code == Code::download && command.b == static_cast<std::uint64_t>(CanMemory::trace) &&
      command.session != trace_session_)
    return "the trace belongs to another host's run";
  const std::uint32_t holder = stage_.session();
  const bool again = command.code == begun_by_.code && command.host == begun_by_.host &&
                     command.sequence == begun_by_.sequence && holder == session_;
  if (holder == 0 || command.session == holder || again) return "";
  return fmt::format("{}; wait until it has ended", meaning(PeerStatus::held).words);
}

void CanNode::obey(const CanCommand& command) {
  std::string refusal = admit(command);
  if (refusal.empty()) {
    refusal = execute(command);
    if (command.session == session_) player_.host_was_heard(transport_.now_ns());
  }
  put_state(&command, refusal.empty() ? CanAnswer::accepted : CanAnswer::refused,
            refusal.empty() ? stage_.trouble() : refusal);
  // The host needs the key in the state before it can accept y[0].
  if (command.code == CanCommandCode::start && refusal.empty()) put_answer();
  flush();
}

/// @returns why the command is refused; empty: executed.
std::string CanNode::execute(const CanCommand& command) {
  switch (command.code) {
    case CanCommandCode::hello:
      return "";
    case CanCommandCode::start:
      return start(command);
    case CanCommandCode::stop:
      if (player_.busy()) {  // comes to rest under control, as no other host owns the stage
        player_.abandon();
        return request(SupervisorCommand::quick_stop);
      }
      stage_.end_run();
      player_.abandon();
      return request(SupervisorCommand::disable);
    case CanCommandCode::quick_stop:
      player_.abandon();
      return request(SupervisorCommand::quick_stop);
    case CanCommandCode::reset_fault:
      return request(SupervisorCommand::reset_fault);
    case CanCommandCode::upload:
      return player_.prepare(command);
    case CanCommandCode::missing:
      outbox_.push_back(encode_can_missing(player_.missing()));
      return "";
    case CanCommandCode::arm:
      return arm(command);
    case CanCommandCode::trigger:
      return player_.trigger(command, transport_.now_ns());
    case CanCommandCode::download:
      return player_.begin_download(command);
  }
  return "unknown command";
}

std::string CanNode::request(SupervisorCommand command) {
  const SupervisorReply reply = stage_.request(command);
  return reply.accepted ? "" : reply.message;
}

std::string CanNode::start(const CanCommand& command) {
  const bool again = stage_.session() == session_ && stage_.state() == NodeState::measuring &&
                     last_sequence_ == 0 && stage_.sample() == 0;
  if (again) return "";
  if (player_.busy()) return "a resident experiment is running; stop it first";
  std::string refusal = request(SupervisorCommand::enable);
  if (!refusal.empty()) return refusal;
  Inputs first;
  first.y = y_;
  try {
    static_cast<void>(stage_.begin_run(command.a, transport_.now_ns(), first, command.session));
  } catch (const StageError& error) {
    return error.what();
  }
  take_over(command);
  static_cast<void>(ticks_.restart());
  last_sequence_ = 0;
  pending_frames_ = 0;
  gaps_ = repeated_ = 0;
  make_answer(0, first.valid);
  return "";
}

std::string CanNode::arm(const CanCommand& command) {
  std::string refusal = player_.arm(command);
  if (!refusal.empty()) return refusal;
  take_over(command);
  trace_session_ = session_;
  player_.host_was_heard(transport_.now_ns());
  return "";
}

/// Makes this command's sender the owner of the new run or reservation.
void CanNode::take_over(const CanCommand& command) {
  session_ = stage_.session();
  begun_by_ = command;
}

/// @param answered the command, or null.
void CanNode::put_state(const CanCommand* answered, CanAnswer answer, const std::string& text) {
  CanState state;
  state.state = announced_ = stage_.state();
  state.run = can_run(session_);
  state.boot = boot_;
  if (answered != nullptr) {
    state.sequence = answered->sequence;
    state.host = answered->host;
    const bool told = answer == CanAnswer::accepted && answered->host == begun_by_.host;
    state.session = told && stage_.session() == session_ ? session_ : 0;
  }
  state.cause = stage_.cause();
  state.answer = answer;
  state.resident = player_.status();
  state.gaps = gaps_;
  state.repeated = repeated_;
  state.rejected = rejected_;
  state.sample = stage_.sample();
  state.fingerprint = layout_.fingerprint;
  // The text is sent first, so that it is complete when the state arrives.
  for (std::size_t part = 0; !text.empty() && part < kCanTextParts; ++part)
    outbox_.push_back(encode_can_text(text, part, can_run(session_)));
  outbox_.push_back(encode_can_state(state));
  next_heartbeat_ns_ = transport_.now_ns() + kHeartbeat_ns;
  state_asked_ = false;
}

void CanNode::announce() {
  const bool changed = stage_.state() != announced_;
  if (changed || state_asked_ || transport_.now_ns() >= next_heartbeat_ns_)
    put_state(nullptr, CanAnswer::none, changed || state_asked_ ? stage_.trouble() : "");
}

void CanNode::flush() {
  if (outbox_.empty()) return;
  static_cast<void>(transport_.send(outbox_));
  outbox_.clear();
}

}  // namespace stageid
