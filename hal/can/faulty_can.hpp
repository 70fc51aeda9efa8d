#pragma once

#include <array>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"
#include "hal/can/can_transport.hpp"

namespace stageid {

/// Simulated transmission faults of value frames (setpoints or measurements).
enum class CanFaultKind : std::uint8_t {
  lost,       ///< does not arrive
  repeated,   ///< arrives twice
  swapped,    ///< arrives after the next one
  late,       ///< arrives `delay_s` later
  corrupt,    ///< one bit is wrong
  shortened,  ///< the last bytes are missing
  foreign     ///< its content arrives under another identifier of this protocol
};
template <>
inline constexpr std::array kWords<CanFaultKind> = {"lost",    "repeated",  "swapped", "late",
                                                    "corrupt", "shortened", "foreign"};

struct CanFault {
  CanFaultKind kind = CanFaultKind::lost;
  std::uint64_t from_frame = 0;  ///< counted over the frames with kCanSensorId or kCanSetpointId
  std::uint64_t frames = 1;
  double delay_s = 0.0;
};

/// "lost@100x3", "late@50x1:0.004": `KIND@FRAME[xCOUNT][:SECONDS]`.
/// @throws std::invalid_argument naming what is wrong.
CanFault parse_can_fault(const std::string& text);

/// Sends through another transport and applies the scripted faults to sent frames. Receiving is not
/// affected.
class FaultyCan final : public CanThrough {
 public:
  FaultyCan(CanTransport& inner, std::vector<CanFault> faults);

  std::size_t send(std::span<const CanFrame> frames) noexcept override;
  std::size_t receive(std::span<CanFrame> frames) noexcept override;
  void wait(std::int64_t until_ns) noexcept override;

 private:
  struct Held {
    CanFrame frame;
    std::int64_t due_ns = 0;
    bool behind_next = false;
  };
  void send_spoiled(CanFrame frame, const CanFault& fault) noexcept;
  void release(bool one_has_passed) noexcept;
  const CanFault* fault_of(std::uint64_t frame) const noexcept;

  std::vector<CanFault> faults_;
  std::vector<Held> held_;
  std::uint64_t count_ = 0;
};

}  // namespace stageid
