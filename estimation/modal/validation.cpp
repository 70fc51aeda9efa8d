#include "estimation/modal/validation.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "estimation/modal/line_correlation.hpp"
#include "frf/response/confidence.hpp"
#include "frf/response/responding_channels.hpp"

namespace stageid {

Eigen::MatrixXcd response_like(const AdditiveModel& model, const FrfEstimate& frf) {
  if (frf.hold == Hold::none) {
    // Continuous data have neither hold nor delay, unless the model was fitted to such data.
    AdditiveModel bare = model;
    if (model.hold != HoldModel::none) {
      bare.input_delay_s.setZero(model.n_inputs());
      bare.output_delay_s.setZero(model.n_outputs());
    }
    return response(bare, frf.frequency_hz, HoldModel::none);
  }
  const HoldModel sampled = model.hold == HoldModel::none ? HoldModel::exact : model.hold;
  if (frf.compensated == Compensation::none) return response(model, frf.frequency_hz, sampled);
  if (model.hold == HoldModel::none) return response(model, frf.frequency_hz, HoldModel::none);
  // The model contains the delay, but it was removed from the data: remove it here too.
  Eigen::MatrixXcd P = response(model, frf.frequency_hz, sampled);
  const double period = 1.0 / frf.sample_rate_hz;
  const Eigen::VectorXd omega = frf.omega_rad_s();
  for (Eigen::Index k = 0; k < P.cols(); ++k) {
    const double x = 0.5 * omega[k] * period;
    const double magnitude = frf.compensated == Compensation::hold ? x / std::sin(x) : 1.0;
    P.col(k) *= std::polar(magnitude, omega[k] * (frf.delay_s + 0.5 * period));
  }
  return P;
}

namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// Equal numbers in different units are not the same response.
void require_same_units(const char* kind, const ChannelList& model, const ChannelList& data) {
  for (std::size_t i = 0; i < model.units.size() && i < data.units.size(); ++i) {
    if (model.units[i].empty() || data.units[i].empty() || model.units[i] == data.units[i])
      continue;
    fail_request("validate: {} {} is in {} in the model and in {} in the data; convert the data",
                 kind, model.names[i], model.units[i], data.units[i]);
  }
}

/// Largest |autocorrelation| of whitened residuals over lines, all channels together, lags 1 to 10.
void fill_whiteness(const Eigen::MatrixXcd& white, Validation& out) {
  const double power = white.cwiseAbs2().sum();
  if (!(power > 0.0) || white.cols() < 20) return;
  for (Eigen::Index lag = 1; lag <= 10; ++lag)
    out.whiteness = std::max(out.whiteness, std::abs(product_at_lag(white, lag)) / power);
  // r|^2 of circular white noise is exponential with mean 1/count; ten lags share the probability of 1 %.
  const double count = static_cast<double>(white.size());
  out.whiteness_limit = std::sqrt(-std::log(1.0 - std::pow(0.99, 0.1)) / count);
}

}  // namespace

Validation validate(const AdditiveModel& model, const FrfEstimate& frf, const Distortion& known) {
  if (model.inputs.names != frf.inputs.names || model.outputs.names != frf.outputs.names)
    fail_request(
        "validate: the model and the FRF have different channels; select the same inputs and "
        "outputs in the same order");
  require_same_units("input", model.inputs, frf.inputs);
  require_same_units("output", model.outputs, frf.outputs);
  const Eigen::MatrixXcd E = frf.response - response_like(model, frf);
  Validation out;
  const Eigen::ArrayXXd squared = E.cwiseAbs2().array();
  const Eigen::ArrayXXd power = frf.response.cwiseAbs2().array();
  const ChannelFlags responding = responding_channels(frf);
  out.relative_rms_error = relative_rms_error(squared, power, responding);
  out.normalized_error = power.sum() > 0.0 ? std::sqrt(squared.sum() / power.sum()) : kUnknown;
  out.channel_error =
      responding.select(relative_channel_error(squared, power).array(), kUnknown).matrix();
  ResidualVerdict verdict = judge_residual(
      frf,
      [&](const ResponseBlock& block) {
        const auto of = [&](const Eigen::MatrixXcd& matrix) {
          return matrix.block(block.first_channel, block.first_line, block.channels, block.lines);
        };
        return Eigen::MatrixXcd(of(frf.response) - of(E));
      },
      {}, 0, known);
  out.variance = verdict.variance;
  out.chi_square_per_dof = verdict.chi_square;
  out.expected_chi_square = verdict.expected;
  out.explained = verdict.explained;
  out.reason = std::move(verdict.reason);
  // Distortion of any size is in the total variance, so the residual may be no larger than that.
  if (out.explained && out.normalized_error >= 1.0) {
    out.explained = false;
    out.reason = fmt::format("the model is worse than none: its error is {:.3g} times the response",
                             out.normalized_error);
  }
  const Eigen::MatrixXd& variance = verdict.scatter.size() > 0 ? verdict.scatter
                                    : verdict.variance == ResidualVariance::total
                                        ? frf.total_variance
                                        : frf.noise_variance;
  if (variance.size() > 0 && variance.minCoeff() > 0.0) {
    out.whitened_above_95 =
        static_cast<double>(
            (squared / variance.array() > squared_error_quantile(0.95, verdict.dof)).count()) /
        static_cast<double>(squared.size());
    fill_whiteness(E.cwiseQuotient(variance.cwiseSqrt().cast<std::complex<double>>()), out);
  }
  return out;
}

}  // namespace stageid
