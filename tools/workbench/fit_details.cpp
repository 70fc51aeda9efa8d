#include "tools/workbench/fit_details.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>
#include <utility>

#include "estimation/uncertainty/dense_covariance.hpp"
#include "tools/control/controller_view.hpp"
#include "tools/exchange/model/model_hdf5.hpp"

namespace stageid {
namespace {

/// Square roots of variances on some lines of an FRF, zero on the others; of none: empty.
report::LogBytes deviation_on_all(const FrfEstimate& frf, const Eigen::VectorXd& frequency_hz,
                                  const Eigen::MatrixXd& variance) {
  if (variance.size() == 0) return {};
  Eigen::MatrixXd deviation = Eigen::MatrixXd::Zero(variance.rows(), frf.lines());
  const auto first =
      std::ranges::lower_bound(frf.frequency_hz, frequency_hz[0]) - frf.frequency_hz.begin();
  deviation.middleCols(first, variance.cols()) =
      variance.unaryExpr([](double v) { return std::sqrt(v); });
  return report::encode_log_bytes(deviation);
}

void add_loop(const StageConfig* stage, const AdditiveModel& model,
              const Eigen::MatrixXd& covariance, const Eigen::VectorXd& frequency_hz,
              FitDetails& details) {
  if (stage == nullptr) return;
  try {
    details.loop =
        controller_view_json(controller_view(*stage, model, covariance, frequency_hz), true).dump();
  } catch (const std::invalid_argument& problem) {
    details.problem = problem.what();
  }
}

}  // namespace

std::shared_ptr<const FitDetails> details_of_files(const ReportInput& input,
                                                   const AdditiveModel& model,
                                                   const FrfEstimate& frf,
                                                   const StageConfig* stage) {
  const auto [low_hz, high_hz] = model.fit.band_hz;
  const Eigen::VectorXd frequency_hz =
      high_hz > low_hz ? select_band(frf, low_hz, high_hz).frequency_hz : frf.frequency_hz;
  FitDetails details;
  if (!input.model_h5.empty())
    details.deviation =
        deviation_on_all(frf, frequency_hz, read_response_variance(input.model_h5, frequency_hz));
  if (input.controller_view.empty())
    add_loop(stage, model, {}, frequency_hz, details);
  else
    details.loop = read_controller_view(input.controller_view, input.model);
  return std::make_shared<const FitDetails>(std::move(details));
}

std::shared_ptr<const FitDetails> details_of_fit(const FitSetup& setup, FitResult result,
                                                 const FrfEstimate& frf, const StageConfig* stage) {
  FitOptions options = setup.options;
  options.delay = result.delay;
  const Eigen::VectorXd& frequency_hz = setup.frf.frequency_hz;
  FitDetails details;
  try {
    fill_covariance(setup.frf, options, result);
    if (result.covariance.response_variance.size() == 0) details.problem = result.decisions.back();
    details.deviation = deviation_on_all(frf, frequency_hz, result.covariance.response_variance);
    add_loop(stage, result.model, result.covariance.sandwich, frequency_hz, details);
  } catch (const std::bad_alloc&) {  // the fit itself is done
    details.problem = "no 95 % band: out of memory";
  }
  return std::make_shared<const FitDetails>(std::move(details));
}

}  // namespace stageid
