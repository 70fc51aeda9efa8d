#pragma once

#include <memory>
#include <string>

#include "estimation/request/fit_request.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/report/report_encoding.hpp"
#include "tools/report/report_input.hpp"

namespace stageid {

/// What the page tells of a finished fit beside its model.
struct FitDetails {
  report::LogBytes deviation;  ///< of the response, on all lines of the FRF; empty: unknown
  std::string loop;     ///< stageid-controller-view with its curves; empty: no controller is known
  std::string problem;  ///< why a part that was expected is missing; empty: none is
};

/// Of an opened model: the band of model.h5, and the controller view of the files, otherwise that of the controller,
/// without discs.
/// @param stage null: no controller is known
/// @throws FileError, FormatError
std::shared_ptr<const FitDetails> details_of_files(const ReportInput& input,
                                                   const AdditiveModel& model,
                                                   const FrfEstimate& frf,
                                                   const StageConfig* stage);

/// Of a fit, from the covariance of its parameters, which is computed here.
std::shared_ptr<const FitDetails> details_of_fit(const FitSetup& setup, FitResult result,
                                                 const FrfEstimate& frf, const StageConfig* stage);

}  // namespace stageid
