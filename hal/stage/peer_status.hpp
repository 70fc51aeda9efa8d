#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "hal/stage/stage.hpp"
#include "hal/stage/supervisor.hpp"

namespace stageid {

/// What a peer, or the wire to it, can say. The worst is last: who hears several things at once goes
/// by the worst.
enum class PeerStatus : std::uint8_t {
  good,
  setpoints_missed,
  late,
  passive,
  incomplete,
  nothing_new,
  damaged,
  out_of_range,
  limit,
  not_measuring,
  fault,
  unknown_code,
  conflict,
  other_node,
  bus_off,
  link_down,
  // Before a run:
  first_sample_missing,
  held,
  in_fault,
  two_nodes,
  other_version,
  other_stage
};

/// What the host does about it.
enum class PeerReaction : std::uint8_t {
  use,    ///< the sample is good
  mark,   ///< the sample is marked in the log; the run goes on
  stop,   ///< the run ends
  refuse  ///< no run begins
};

struct PeerMeaning {
  PeerStatus status = PeerStatus::good;
  PeerReaction reaction = PeerReaction::use;
  Outcome outcome = Outcome::ok;  ///< of the exchange; of no meaning for `refuse`
  const char* words = "";         ///< for people
  const char* can = "";           ///< how it is seen over CAN FD
  const char* modbus = "";        ///< and over Modbus
};

/// The one meaning of each status, by status. docs/stops.md has the same table.
std::span<const PeerMeaning> peer_meanings() noexcept;
const PeerMeaning& meaning(PeerStatus status) noexcept;

/// What a node says of one sample. Codes are as they came; they may be unknown.
struct PeerReport {
  std::uint8_t outcome = 0;  ///< of its own exchange with the stage
  NodeState state = NodeState::measuring;
  FaultCause cause = FaultCause::none;
  std::uint64_t valid = 0;  ///< bit i: sensor i has a value
  std::uint64_t all = 0;    ///< bits of all sensors
  bool setpoints_missed = false;
  bool out_of_range = false;
};

/// The worst that it says.
PeerStatus judge(const PeerReport& report) noexcept;

/// The Outcome that a code on the wire stands for; of unknown codes Outcome::fault.
Outcome outcome_of_code(std::uint8_t code) noexcept;

/// @throws StageError "PLACE: WORDS DETAIL".
[[noreturn]] void refuse(PeerStatus status, const std::string& place, const std::string& detail);

/// The meanings as a Markdown table, as in docs/stops.md.
std::string peer_meanings_table();

}  // namespace stageid
