#pragma once

#include <string>
#include <vector>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/request/fit_request.hpp"
#include "tools/terminal/console.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

struct FitStep {
  FitResult result;  ///< model with provenance; decisions begin with those of the setup
  double seconds = 0.0;
};

/// Fits, distrusts a model of faulty data, and adds the provenance: the model that `stageid fit` writes.
/// @param options those of the setup, with callbacks of the caller
/// @param frf_name, frf_fingerprint of the fitted FRF.
/// @throws what fit_model() throws
FitResult complete_fit(const FitSetup& setup, const FitOptions& options,
                       const std::string& frf_name, const std::string& frf_fingerprint);

/// The same with progress on the console. A signal ends the fit with the best model so far,
/// FitStatus::interrupted; before the first step there is none.
/// @param frf_name, frf_fingerprint of the fitted FRF.
/// @throws std::invalid_argument, Interrupted
FitStep fit_with_progress(const FitSetup& setup, const std::string& frf_name,
                          const std::string& frf_fingerprint, const Console& console);

/// The findings that the message of a fit does not tell already.
std::vector<std::string> findings_beside_message(const FitResult& result);

/// Identifies a request for a fit, see frf_request_id().
std::string fit_request_id(const FitSetup& setup, const std::string& frf_fingerprint);

/// The distortion in the provenance of a model, known when it was fitted.
Distortion distortion_of(const AdditiveModel& model);

/// The decisions in the provenance of a model.
std::vector<std::string> decisions_of(const AdditiveModel& model);

/// "relative error 0.012", or a text that no channel responds.
std::string relative_error_text(const FitRecord& fit);

/// For people: table of modes with standard deviations; cost history in one line.
std::vector<std::string> mode_table(const AdditiveModel& model);
std::string cost_line(const std::vector<double>& cost);
/// The delays of the model with the deviations of estimated ones: one line for a common delay, else one per channel;
/// empty without a delay.
std::vector<std::string> delay_lines(const AdditiveModel& model);
/// The same for --json.
Json modes_json(const AdditiveModel& model);
/// Keys as in model.json: input_delay_s, output_delay_s, and input_delay_std_s, output_delay_std_s if known.
Json delays_json(const AdditiveModel& model);

}  // namespace stageid
