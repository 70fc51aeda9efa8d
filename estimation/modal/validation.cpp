#include "estimation/modal/validation.hpp"

#include <fmt/format.h>

#include <cmath>
#include <complex>
#include <limits>
#include <memory>
#include <numbers>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "estimation/modal/line_correlation.hpp"
#include "frf/response/channel_tiles.hpp"
#include "frf/response/confidence.hpp"
#include "frf/response/responding_channels.hpp"

namespace stageid {
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

/// How the samples are held in data like these.
HoldModel hold_like(const AdditiveModel& model, const FrfEstimate& frf) {
  if (frf.hold == Hold::none) return HoldModel::none;
  if (model.hold != HoldModel::none) return model.hold;
  return frf.compensated == Compensation::none ? HoldModel::exact : HoldModel::none;
}

/// The response of the model as it would have been measured. Both must outlive the result.
ModelBlockResponse blocks_like(const AdditiveModel& model, const FrfEstimate& frf) {
  const AdditiveModel* seen = &model;
  std::shared_ptr<AdditiveModel> without_delay;
  if (frf.hold == Hold::none && model.hold != HoldModel::none) {
    // Delays are not in continuous data, unless the model was fitted to such data.
    without_delay = std::make_shared<AdditiveModel>(model);
    without_delay->input_delay_s.setZero(model.n_inputs());
    without_delay->output_delay_s.setZero(model.n_outputs());
    seen = without_delay.get();
  }
  return [&frf, seen, without_delay, hold = hold_like(model, frf)](const ResponseBlock& block) {
    const auto [first_channel, channels, first, lines] = block;
    Eigen::MatrixXcd P =
        response(*seen, frf.frequency_hz.segment(first, lines), hold, first_channel, channels);
    if (hold == HoldModel::none || frf.compensated == Compensation::none) return P;
    // The model contains the delay, but it was removed from the data: remove it here too.
    const double period = 1.0 / frf.sample_rate_hz;
    for (Eigen::Index k = 0; k < lines; ++k) {
      const double omega = 2.0 * std::numbers::pi * frf.frequency_hz[first + k];
      const double x = 0.5 * omega * period;
      const double magnitude = frf.compensated == Compensation::hold ? x / std::sin(x) : 1.0;
      P.col(k) *= std::polar(magnitude, omega * (frf.delay_s + 0.5 * period));
    }
    return P;
  };
}

/// Sums over the lines of each channel, as columns; the first two are relative_squares().
enum Of : Eigen::Index { kRelative, kError = 2, kResponse, kResponds, kSums };

/// Of all channels, in every process.
Eigen::MatrixXd sums_of_channels(const FrfEstimate& frf, const ModelBlockResponse& model) {
  Eigen::MatrixXd sums(frf.response.rows(), Eigen::Index{kSums});
  sums.col(kResponds) = responding_channels(frf).cast<double>().matrix();
  for_each_own_tile(*frf.team, sums.rows(), [&](const DataRange& tile) {
    const auto [first, count] = tile;
    const Eigen::MatrixXcd G = frf.response.middleRows(first, count);
    const Eigen::ArrayXXd error = (G - model({first, count, 0, frf.lines()})).cwiseAbs2();
    const Eigen::ArrayXXd power = G.cwiseAbs2();
    sums.block(first, kRelative, count, 2) = relative_squares(error, power);
    sums.col(kError).segment(first, count) = error.rowwise().sum();
    sums.col(kResponse).segment(first, count) = power.rowwise().sum();
  });
  frf.team->gather_rows(kTileChannels, sums);
  return sums;
}

constexpr Eigen::Index kLags = 10;

/// How white the residual is, and how many of its numbers exceed their 95 % point.
void fill_whiteness(const FrfEstimate& frf, const ModelBlockResponse& model,
                    const Eigen::MatrixXd& variance, double dof, Validation& out) {
  const auto [own, of_own] = frf.own();
  if (variance.size() == 0 || frf.any(!(variance.middleRows(own, of_own).array() > 0.0).all()))
    return;
  const double limit = squared_error_quantile(0.95, dof);
  const Eigen::Index lags = frf.lines() < 20 ? 0 : kLags;
  const auto of_tile = [&](const DataRange& tile) {
    const Eigen::MatrixXcd white = white_residual(frf, model, variance, tile);
    Eigen::VectorXd part(2 + 2 * lags);
    part[0] = static_cast<double>((white.cwiseAbs2().array() > limit).count());
    part[1] = white.squaredNorm();
    for (Eigen::Index lag = 1; lag <= lags; ++lag) {
      const std::complex<double> product = product_at_lag(white, lag);
      part.segment<2>(2 * lag) << product.real(), product.imag();
    }
    return part;
  };
  const Eigen::VectorXd sums =
      sum_over_tiles(*frf.team, frf.response.rows(), 2 + 2 * lags, of_tile);
  const auto count = static_cast<double>(frf.response.size());
  out.whitened_above_95 = sums[0] / count;
  if (!(sums[1] > 0.0) || lags == 0) return;
  for (Eigen::Index lag = 1; lag <= lags; ++lag)
    out.whiteness = std::max(out.whiteness, sums.segment<2>(2 * lag).norm() / sums[1]);
  // |r|^2 of circular white noise is exponential with mean 1/count; ten lags share the probability of 1 %.
  out.whiteness_limit = std::sqrt(-std::log(1.0 - std::pow(0.99, 0.1)) / count);
}

}  // namespace

Eigen::MatrixXcd response_like(const AdditiveModel& model, const FrfEstimate& frf) {
  return blocks_like(model, frf)({0, frf.response.rows(), 0, frf.lines()});
}

Validation validate(const AdditiveModel& model, const FrfEstimate& frf, const Distortion& known) {
  if (model.inputs.names != frf.inputs.names || model.outputs.names != frf.outputs.names)
    fail_request(
        "validate: the model and the FRF have different channels; select the same inputs and "
        "outputs in the same order");
  require_same_units("input", model.inputs, frf.inputs);
  require_same_units("output", model.outputs, frf.outputs);
  const ModelBlockResponse in_block = blocks_like(model, frf);
  const Eigen::MatrixXd sums = sums_of_channels(frf, in_block);
  const ChannelFlags responds = sums.col(kResponds).array() > 0.0;
  const Eigen::ArrayX2d relative = sums.middleCols(kRelative, 2);
  Validation out;
  out.relative_rms_error = relative_rms_error(relative, responds);
  const double power = sums.col(kResponse).sum();
  out.normalized_error = power > 0.0 ? std::sqrt(sums.col(kError).sum() / power) : kUnknown;
  out.channel_error = responds.select((relative.col(0) / relative.col(1)).sqrt(), kUnknown);

  ResidualVerdict verdict = judge_residual(frf, in_block, {}, 0, known);
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
  fill_whiteness(frf, in_block, variance, verdict.dof, out);
  return out;
}

}  // namespace stageid
