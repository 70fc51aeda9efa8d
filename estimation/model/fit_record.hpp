#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

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

/// A reason not to trust a fit.
struct FitReason {
  FitStatus status = FitStatus::unexplained;
  std::string what{};    ///< the problem
  std::string remedy{};  ///< one sentence; empty: none is known
  std::string flags{};   ///< of `stageid fit`, which apply the remedy: "--delay estimate"

  /// "what. remedy"
  std::string text() const { return remedy.empty() ? what : what + ". " + remedy; }
};

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
  std::vector<FitReason> reasons = {};  ///< those of distrust(); why() also has the others

  /// A model without a status is trusted.
  bool trustworthy() const noexcept;
  /// The word of the status; empty if unknown.
  std::string status_word() const { return status ? to_string(*status) : ""; }
  /// Adds a reason not to trust the fit, to status and message. The gravest reason is the status. Order: interrupt,
  /// faulty data, budget, no convergence, unexplained residual, undetermined modes. In the message and in `reasons`, one
  /// whose remedy was tried on the data comes before the others of the fit: it is their cause.
  void distrust(FitReason reason);
  /// All reasons not to trust the fit, causes before their consequences.
  std::vector<FitReason> why() const;
};

}  // namespace stageid
