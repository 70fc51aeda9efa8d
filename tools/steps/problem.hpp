#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "frf/periods/health_finding.hpp"
#include "frf/response/frf_estimate.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

// Causes of problems that are not those of a finding or the status of a fit.
inline constexpr const char* kLosses = "losses";       ///< lost or marked samples
inline constexpr const char* kHeldBack = "held_back";  ///< the model does not explain other data
inline constexpr const char* kNonlinear = "nonlinear";

/// One thing that is wrong with a result.
struct Problem {
  std::string cause;      ///< for programs: a word of Cause or FitStatus, or one of docs/formats.md
  bool grave = false;     ///< the result is not to be trusted
  std::string what;       ///< with numbers
  std::string remedy{};   ///< what to do
  std::string flags{};    ///< of `stageid fit`, for a refit
  std::string command{};  ///< that does it or begins it, complete; empty: none is known

  /// Whether the cause is this status of a fit.
  bool is(FitStatus status) const { return cause == to_string(status); }
  /// "what. Remedy", for lines without the command
  std::string text() const;
};

/// Problems in a head; the others are in the lists behind it.
inline constexpr std::size_t kMostInHead = 3;

/// Sorts by the one ranking of all outputs: causes before their consequences. Removes what is there twice.
void rank(std::vector<Problem>& problems);

/// Whether the first problem explains all that follows: a fault of the data, or a response of noise. What else was found
/// is then its consequence. @param problems ranked
bool explain_the_rest(const std::vector<Problem>& problems);

/// Problems of a response before any fit: faults and doubts of its health, a response that is noise, nonlinearity, a
/// single realization.
std::vector<Problem> problems_of(const FrfEstimate& frf);
/// The same of its health alone.
std::vector<Problem> problems_of(const std::vector<Finding>& health);
/// The same as stored in a model, and why its fit is not to be trusted.
std::vector<Problem> problems_of(const AdditiveModel& model);

/// The first problems for people: the text of each, and its command on a line of its own.
/// @param prefix of the first line
std::vector<std::string> head_lines(std::string prefix, const std::vector<Problem>& problems);
/// The same as a warning about a file that is not to be trusted.
void warn_of(const std::vector<Problem>& problems, const std::filesystem::path& file,
             const Console& console);
/// The same for programs, "head": cause, what, remedy, command; and "reasons": the texts of all problems.
Json head_json(const std::vector<Problem>& problems);
/// As stored in a model.
Json stored(const std::vector<Problem>& problems);

}  // namespace stageid
