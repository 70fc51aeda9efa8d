#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// How the number of modes was determined.
enum class ModeNumber : std::uint8_t {
  chosen,  ///< by a search, which may continue
  asked,   ///< the request, as a number
  given    ///< the request, as a list of modes
};

/// Two modes that one would replace.
struct AlikeModes {
  std::size_t first;
  std::size_t second;
  double cost;  ///< with one
};

/// What is known about a fit besides its numbers.
struct FitEvidence {
  ModeNumber number = ModeNumber::chosen;
  std::vector<AlikeModes> alike = {};
  std::string low_ranks = {};  ///< residues need a higher rank than requested
  /// A delay, which is not to be estimated, explains more than modes do.
  std::string delay_denied = {};
  std::optional<FitReason> limit = {};  ///< the search was interrupted or reached its budget
  std::string late_channels = {};
  std::optional<FitReason> unexplained = {};  ///< by noise and known distortion
  std::string overestimated = {};             ///< variances
};

/// The largest standard deviation of a pole: of its damping ratio relative to itself, or of its frequency relative to
/// half the half-power width. For a suspension, whose resonance is not on the lines, of the frequency relative to
/// itself. Infinite at a bound, 0 for a pole that is held by request. A pole with 1 or more is not determined.
double pole_doubt(const FitResult& fit, std::size_t submodel);

/// The nearest pair of modes that converged to each other: closer than the deviation of either frequency. Their limit
/// is a double pole with residues that grow without bound and cancel.
std::optional<std::pair<std::size_t, std::size_t>> coincident_pair(const AdditiveModel& model);

/// The verdict on a searched mode; `determined` for other submodels.
/// @param number if asked or given, the modes were not selected by their worth: one that is not worth its parameters
/// (ModeWorth::price()) is weak. If asked, one that is held because noise hides it (hold_hidden_modes()) is weak, too,
/// and one outside the lines by less than half its half-power width is judged like others
ModeVerdict mode_verdict(const FrfEstimate& frf, ModeNumber number, const FitResult& fit,
                         std::size_t submodel);

/// Whether no mode is weak or at a bound.
bool supports_all_modes(const FrfEstimate& frf, const FitEvidence& evidence, const FitResult& fit);

/// Pairs of overlapping modes that a single one could replace: a surplus mode may split a real one. At most four pairs
/// are tried, one fit each.
std::vector<AlikeModes> alike_modes(const FrfEstimate& frf, const FitOptions& options,
                                    const FitResult& fit);

/// The channels whose delay differs from the median of the other inputs or outputs by more than five standard
/// deviations, as a finding; empty if there are none. @pre model.sample_rate_hz > 0
std::string late_channels(const AdditiveModel& model);

/// The verdict on a fit: those on its modes, its status with the reasons, and the findings. Nothing else changes them
/// after the last iteration.
void judge(const FrfEstimate& frf, const FitEvidence& evidence, FitResult& fit);

}  // namespace stageid
