#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace stageid {

/// What a finding means for whoever wants to fit.
enum class Severity : std::uint8_t {
  fault,     ///< the data are not what they say: do not fit
  doubt,     ///< usable, but look at it first
  unchecked  ///< nothing is known: the log does not hold what the check needs
};
const char* to_string(Severity severity) noexcept;

/// The kinds of causes, for programs; `what` says it to people.
enum class Cause : std::uint8_t {
  dead,
  saturated,
  marked,
  late,
  swapped,
  sign,
  scale,
  skew,
  unrecorded,     ///< an actuator moves by more than excitation and controller
  controller,     ///< the log's controller is not the configuration's
  rigid_body,     ///< the plant's rigid body is not the configuration's
  unknown_stage,  ///< neither controller nor geometry are known: most causes cannot be seen
  injection,      ///< an actuator's record is the excitation, before the sum
  excluded,       ///< an actuator outside the sub-plant moves on the excited lines
  excitation,     ///< cond(R)
  inputs,         ///< cond(U)
  incoherent,
  interpolation,      ///< zippered lines: a local model leaves more than noise
  aperiodic,          ///< the inputs do not repeat with the period
  unsettled,          ///< a transient or a drift: linearity cannot be told
  uneven_noise,       ///< the noise of one experiment is not that of another
  lost_samples,       ///< samples are missing in a run, or are there twice
  excitation_timing,  ///< the excitation was recorded whole samples late or early
  drift,              ///< the response changes during the measurement
};
const char* to_string(Cause cause) noexcept;
/// The cause of that name; nothing if there is none.
std::optional<Cause> cause_of(std::string_view name) noexcept;

/// Runs, frequencies or channels that a finding lists by name; it counts the rest.
inline constexpr std::size_t kMostNamed = 4;

/// One line of the table of health: one cause.
struct Finding {
  Severity severity = Severity::fault;
  Cause cause = Cause::dead;
  std::string channel;  ///< names, "a3 a7"; empty: the whole log
  std::string what;     ///< what is wrong, or what is not checked
  std::string figure;   ///< the number that says so
  std::string remedy;   ///< what to do, or what the check needs
};

/// Place in the table: faults, then that nothing is known of the stage, doubts, what else is not checked.
int rank_of(const Finding& finding) noexcept;

/// The worst severity is a fault.
bool any_fault(const std::vector<Finding>& findings) noexcept;

}  // namespace stageid
