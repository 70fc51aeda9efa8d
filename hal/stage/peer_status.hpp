#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "excitation/words/words.hpp"
#include "hal/stage/stage.hpp"
#include "hal/stage/supervisor.hpp"

namespace stageid {

/// Conditions that a peer, or the link to it, can report, the worst last. If there are several, the worst
/// applies.
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
  // Only before a run:
  first_sample_missing,
  held,
  in_fault,
  two_nodes,
  other_version,
  other_stage
};

/// Reaction of the host.
enum class PeerReaction : std::uint8_t {
  use,    ///< the sample is good
  mark,   ///< the sample is marked in the log; the run continues
  stop,   ///< the run ends
  refuse  ///< the run does not begin
};
template <>
inline constexpr std::array kWords<PeerReaction> = {"use", "mark", "stop", "refuse"};

struct PeerMeaning {
  PeerStatus status = PeerStatus::good;
  PeerReaction reaction = PeerReaction::use;
  Outcome outcome = Outcome::ok;  ///< of the exchange; unused for `refuse`
  const char* words = "";         ///< for the user
};

/// The meanings of all statuses, in order of the status. docs/stops.md has the same table, and how each is detected.
std::span<const PeerMeaning> peer_meanings() noexcept;
const PeerMeaning& meaning(PeerStatus status) noexcept;

/// A node's report on one sample. Codes are as received and may be unknown.
struct PeerReport {
  std::uint8_t outcome = 0;  ///< of its own exchange with the stage
  NodeState state = NodeState::measuring;
  FaultCause cause = FaultCause::none;
  std::uint64_t valid = 0;  ///< bit i: sensor i has a value
  std::uint64_t all = 0;    ///< bits of all sensors
  bool setpoints_missed = false;
  bool out_of_range = false;
};

/// The worst status of the report.
PeerStatus judge(const PeerReport& report) noexcept;

/// The Outcome of a received code; unknown codes give Outcome::fault.
Outcome outcome_of_code(std::uint8_t code) noexcept;

/// @throws StageError "PLACE: WORDS DETAIL".
[[noreturn]] void refuse(PeerStatus status, const std::string& place, const std::string& detail);

}  // namespace stageid
