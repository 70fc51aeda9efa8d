#include "hal/can/faulty_can.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <regex>
#include <utility>

#include "excitation/words/require.hpp"
#include "hal/can/can_layout.hpp"

namespace stageid {
namespace {

bool carries_values(const CanFrame& frame) {
  return (frame.id & 0x780) == kCanSetpointId || (frame.id & 0x780) == kCanSensorId;
}

}  // namespace

CanFault parse_can_fault(const std::string& text) {
  static const std::regex form("([a-z]+)@([0-9]{1,15})(x([0-9]{1,15}))?(:([0-9.e-]{1,20}))?");
  std::smatch part;
  const bool formed = std::regex_match(text, part, form);
  const auto kind = formed ? from_word<CanFaultKind>(part[1].str()) : std::nullopt;
  require(kind.has_value(), "'{}': expected KIND@FRAME[xCOUNT][:SECONDS], where KIND is one of {}",
          text, fmt::join(kWords<CanFaultKind>, ", "));
  CanFault fault;
  fault.kind = *kind;
  fault.from_frame = std::stoull(part[2]);
  if (part[4].matched) fault.frames = std::stoull(part[4]);
  if (part[6].matched) {
    try {
      fault.delay_s = std::stod(part[6]);
    } catch (const std::exception&) {
      throw std::invalid_argument(
          fmt::format("'{}': '{}' is not a valid time in seconds", text, part[6].str()));
    }
  }
  require(fault.kind != CanFaultKind::late || (fault.delay_s > 0.0 && fault.delay_s <= 60.0),
          "'{}': late needs a time of 0 to 60 s, for example late@100:0.004", text);
  return fault;
}

FaultyCan::FaultyCan(CanTransport& inner, std::vector<CanFault> faults)
    : CanThrough(inner), faults_(std::move(faults)) {}

const CanFault* FaultyCan::fault_of(std::uint64_t frame) const noexcept {
  for (const CanFault& fault : faults_)
    if (frame >= fault.from_frame && frame - fault.from_frame < fault.frames) return &fault;
  return nullptr;
}

std::size_t FaultyCan::send(std::span<const CanFrame> frames) noexcept {
  for (const CanFrame& frame : frames) {
    const CanFault* fault = carries_values(frame) ? fault_of(count_++) : nullptr;
    if (fault == nullptr) {
      static_cast<void>(CanThrough::send({&frame, 1}));
      release(true);
    } else {
      send_spoiled(frame, *fault);
    }
  }
  return frames.size();
}

void FaultyCan::send_spoiled(CanFrame frame, const CanFault& fault) noexcept {
  switch (fault.kind) {
    case CanFaultKind::lost:
      return;
    case CanFaultKind::repeated:
      static_cast<void>(CanThrough::send({&frame, 1}));
      break;
    case CanFaultKind::swapped:
      held_.push_back({frame, 0, true});
      return;
    case CanFaultKind::late:
      held_.push_back({frame, now_ns() + std::llround(1e9 * fault.delay_s), false});
      return;
    case CanFaultKind::corrupt:
      frame.data[kCanHeaderBytes] ^= 0x10;
      break;
    case CanFaultKind::shortened:
      frame.length = static_cast<std::uint8_t>(can_fd_length(kCanHeaderBytes));
      break;
    case CanFaultKind::foreign:
      frame.id ^= 0x001;
      break;
  }
  static_cast<void>(CanThrough::send({&frame, 1}));
}

void FaultyCan::release(bool one_has_passed) noexcept {
  std::erase_if(held_, [&](const Held& held) {
    const bool due = held.behind_next ? one_has_passed : held.due_ns <= now_ns();
    if (due) static_cast<void>(CanThrough::send({&held.frame, 1}));
    return due;
  });
}

std::size_t FaultyCan::receive(std::span<CanFrame> frames) noexcept {
  release(false);
  return CanThrough::receive(frames);
}

void FaultyCan::wait(std::int64_t until_ns) noexcept {
  std::int64_t until = until_ns;
  for (const Held& held : held_)
    if (!held.behind_next) until = std::min(until, held.due_ns);
  CanThrough::wait(until);
  release(false);
}

}  // namespace stageid
