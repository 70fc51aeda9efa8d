#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "excitation/words/words.hpp"

namespace stageid {

enum class FitStatus : std::uint8_t {
  gradient_small,
  step_small,
  cost_stalled,
  iteration_limit,
  singular,
  undetermined,   ///< converged, but the data do not determine a requested mode or submodel
  unexplained,    ///< converged, but the residual is clearly larger than noise and known distortion
  faulty_data,    ///< the health check of the data found a fault
  search_budget,  ///< the search used its budget, see SearchLimit
  interrupted     ///< by the user, see SearchLimit
};
template <>
inline constexpr std::array kWords<FitStatus> = {
    "gradient_small", "step_small",  "cost_stalled", "iteration_limit", "singular",
    "undetermined",   "unexplained", "faulty_data",  "search_budget",   "interrupted"};

/// Outcome of a fit, as stored in the model file.
struct FitRecord {
  double cost = 0.0;  ///< 1/(2N) sum vec(E)^H W vec(E)
  std::string weighting;
  int iterations = 0;
  std::optional<FitStatus> status = {};  ///< none: unknown, a model from another program
  std::string message;  ///< how the fit ended; in files only the reasons not to trust it
  double relative_rms_error = 0.0;  ///< sqrt(mean |E|^2/|G|^2) over lines and channels
  double band_hz[2] = {0.0, 0.0};
  double seconds = 0.0;

  /// A model without a status is trusted.
  bool trustworthy() const noexcept;
  /// The word of the status; empty if unknown.
  std::string status_word() const { return status ? to_string(*status) : ""; }
  /// Adds a reason not to trust the fit, to status and message. The gravest reason is the status and the first in the
  /// message. Order: interrupt, faulty data, budget, no convergence, unexplained residual, undetermined modes.
  void distrust(FitStatus why, const std::string& reason);
};

}  // namespace stageid
