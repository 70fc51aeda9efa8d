#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"

namespace stageid {

/// Consequence of a finding for a fit.
enum class Severity : std::uint8_t {
  fault,     ///< the data are wrong: do not fit
  doubt,     ///< usable, but examine the cause first
  unchecked  ///< not checked: the log lacks the required data
};
template <>
inline constexpr std::array kWords<Severity> = {"fault", "doubt", "not checked"};

/// Kinds of causes, for programs; `what` is their text for users.
enum class Cause : std::uint8_t {
  dead,
  saturated,
  marked,
  late,
  swapped,
  sign,
  scale,
  skew,
  unrecorded,     ///< an actuator moves by more than excitation and controller explain
  controller,     ///< the log's controller differs from the configured one
  rigid_body,     ///< the plant's rigid body differs from the configured one
  unknown_stage,  ///< controller and geometry are unknown, so most causes cannot be detected
  injection,      ///< an actuator's record is the excitation before the summation point
  excluded,       ///< an actuator outside the sub-plant moves on the excited lines
  excitation,     ///< cond(R)
  inputs,         ///< cond(U)
  incoherent,
  interpolation,      ///< zippered lines: a local model leaves more than noise
  aperiodic,          ///< the inputs do not repeat with the period
  unsettled,          ///< a transient or a drift prevents the linearity test
  uneven_noise,       ///< the noise differs between experiments
  limit_cycle,        ///< it differs by so much that the loop oscillates by itself in some of them
  lost_samples,       ///< samples of a run are missing or duplicated
  excitation_timing,  ///< the excitation was recorded whole samples late or early
  drift,              ///< the response changes during the measurement
  actuator_step,      ///< an actuator applies its recorded command in coarse steps
  resolution,         ///< a channel moves by few steps of its converter, or is dead
};
template <>
inline constexpr std::array kWords<Cause> = {
    "dead",         "saturated",     "marked",       "late",
    "swapped",      "sign",          "scale",        "skew",
    "unrecorded",   "controller",    "rigid_body",   "unknown_stage",
    "injection",    "excluded",      "excitation",   "inputs",
    "incoherent",   "interpolation", "aperiodic",    "unsettled",
    "uneven_noise", "limit_cycle",   "lost_samples", "excitation_timing",
    "drift",        "actuator_step", "resolution"};

/// Significance of a check over all channels.
inline constexpr double kSignificance = 1e-4;

/// Standard deviations of a systematic error: no interval holds.
inline constexpr double kMisleading = 3.0;

/// Runs, frequencies or channels that a finding lists by name; it counts the rest.
inline constexpr std::size_t kMostNamed = 4;

/// One row of the health table: one cause.
struct Finding {
  Severity severity = Severity::fault;
  Cause cause = Cause::dead;
  std::string channel;  ///< names, "a3 a7"; empty: the whole log
  std::string what;     ///< the problem, or the unchecked property
  std::string figure;   ///< the evidence as a number
  std::string remedy;   ///< the remedy, or the missing data
  /// Counted from 0; empty: all of them. `what` names them. For programs within the process only.
  std::vector<int> realizations{};
};

/// "realization 3", "realizations 2, 3", "realizations 1, 2, 3, 4 and 6 more". @pre counted from 0, not empty
std::string named_realizations(const std::vector<int>& realizations);

/// Order in the table: faults (first those that cause others), an unknown stage, doubts (uneven noise last), other
/// unchecked properties.
int rank_of(const Finding& finding) noexcept;

/// Whether there is a fault.
bool any_fault(const std::vector<Finding>& findings) noexcept;

}  // namespace stageid
