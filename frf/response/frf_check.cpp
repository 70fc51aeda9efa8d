// check(): invariants of every frequency response.
#include <fmt/format.h>

#include <cmath>
#include <set>
#include <stdexcept>

#include "acquisition/files/counted.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/nonlinearity_sentence.hpp"

namespace stageid {
namespace {

[[noreturn]] void refuse(const std::string& place, const std::string& wrong) {
  throw std::invalid_argument(place + ": " + wrong);
}

void check_names(const char* place, const ChannelList& channels) {
  if (channels.names.empty()) refuse(place, "no channels; name at least one");
  if (channels.units.size() != channels.names.size()) {
    refuse(place,
           fmt::format("{} for {}; give one per channel", counted(channels.units.size(), "unit"),
                       counted(channels.names.size(), "channel")));
  }
  std::set<std::string> seen;
  for (const std::string& name : channels.names) {
    if (!seen.insert(name).second) {
      refuse(place, fmt::format("duplicate channel name '{}'", name));
    }
  }
}

void check_frequencies(const FrfEstimate& frf) {
  const Eigen::VectorXd& f = frf.frequency_hz;
  if (f.size() == 0) refuse("frequency_hz", "no lines; give at least one");
  for (Eigen::Index k = 0; k < f.size(); ++k) {
    const std::string place = fmt::format("frequency_hz[line {}]", k);
    if (!std::isfinite(f[k]) || f[k] < 0.0) {
      refuse(place, "must be finite and at least 0");
    }
    if (k > 0 && !(f[k] > f[k - 1])) {
      refuse(place, fmt::format("{} Hz after {} Hz; frequencies must be strictly increasing", f[k],
                                f[k - 1]));
    }
  }
  const double last = f[f.size() - 1];
  if (frf.hold == Hold::zoh && frf.sample_rate_hz > 0.0 && last > 0.5 * frf.sample_rate_hz) {
    refuse(fmt::format("frequency_hz[line {}]", f.size() - 1),
           fmt::format("{} Hz is above half the sample rate of {} Hz", last, frf.sample_rate_hz));
  }
}

std::string entry_place(const char* dataset, const FrfEstimate& frf, Eigen::Index c,
                        Eigen::Index k) {
  return fmt::format("{}[line {}, {}]", dataset, k, pair_name(frf, c));
}

template <typename Matrix>
void check_shape(const char* dataset, const Matrix& matrix, Eigen::Index rows, Eigen::Index lines) {
  if (matrix.rows() != rows || matrix.cols() != lines) {
    refuse(dataset, fmt::format("{} values on {} lines; expected {} on {}", matrix.rows(),
                                matrix.cols(), rows, lines));
  }
}

void check_variance(const char* dataset, const FrfEstimate& frf, const Eigen::MatrixXd& variance) {
  if (variance.size() == 0) return;
  check_shape(dataset, variance, frf.n_outputs() * frf.n_inputs(), frf.lines());
  const auto [first, count] = frf.own();
  for (Eigen::Index k = 0; k < variance.cols(); ++k) {
    for (Eigen::Index c = first; c < first + count; ++c) {
      if (!std::isfinite(variance(c, k))) refuse(entry_place(dataset, frf, c, k), "not finite");
      if (variance(c, k) < 0.0)
        refuse(entry_place(dataset, frf, c, k), "a variance must be 0 or more");
    }
  }
}

/// A dataset of numbers without own channel names.
template <typename Matrix>
void check_numbers(const char* dataset, const Matrix& matrix, Eigen::Index rows,
                   Eigen::Index lines) {
  check_shape(dataset, matrix, rows, lines);
  for (Eigen::Index k = 0; k < matrix.cols(); ++k)
    if (!matrix.col(k).allFinite()) refuse(fmt::format("{}[line {}]", dataset, k), "not finite");
}

template <typename Matrix>
void check_optional(const char* dataset, const Matrix& matrix, Eigen::Index rows,
                    Eigen::Index lines) {
  if (matrix.size() > 0) check_numbers(dataset, matrix, rows, lines);
}

void check_scalars(const FrfEstimate& frf) {
  if (!std::isfinite(frf.sample_rate_hz) || frf.sample_rate_hz < 0.0) {
    refuse("sample_rate_hz", "must be finite and at least 0 (0: unknown)");
  }
  if (!std::isfinite(frf.delay_s)) refuse("delay_s", "not finite");
  if (!std::isfinite(frf.experiment_noise_ratio) || frf.experiment_noise_ratio < 1.0)
    refuse("experiment_noise_ratio", "must be finite and at least 1");
  if (!std::isfinite(frf.correlated_lines) || frf.correlated_lines < 1.0)
    refuse("correlated_lines", "must be finite and at least 1");
  for (const double dof : {frf.noise_dof, frf.total_dof}) {
    if (!std::isfinite(dof) || dof < 0.0)
      refuse("noise_dof, total_dof", "must be finite and at least 0");
  }
}

void check_detection(const FrfEstimate& frf) {
  const DetectionLines& lines = frf.detection;
  const Eigen::Index D = lines.frequency_hz.size();
  const Eigen::Index rows = frf.n_outputs() * std::ssize(lines.groups);
  if (lines.line.size() != D)
    refuse("detection_line", "must have as many values as there are frequencies");
  if (D == 0) return;
  if (lines.runs.size() != std::ssize(lines.groups))
    refuse("detection_runs", fmt::format("{} values for {} groups; give one per group",
                                         lines.runs.size(), lines.groups.size()));
  if (!lines.runs.allFinite() || !lines.frequency_hz.allFinite() || !std::isfinite(lines.noise_dof))
    refuse("detection_frequency_hz", "the frequencies, detection_runs and the dof must be finite");
  check_numbers("detection_power", lines.power, rows, D);
  check_numbers("detection_noise", lines.noise, frf.n_outputs(), D);
  check_optional("detection_linear_power", lines.linear_power, rows, frf.lines());
}

void check_nonlinearity(const FrfEstimate& frf) {
  const NonlinearityTest& test = frf.nonlinearity;
  const Eigen::Index bands = test.band_hz.rows();
  if (bands == 0) return;
  if (test.band_hz.cols() != 2 || !test.band_hz.allFinite())
    refuse("nonlinearity_band_hz", "expected two finite frequencies per band");
  const Eigen::Index n_c = frf.n_outputs() * frf.n_inputs();
  check_numbers("nonlinearity_p_value", test.p_value, n_c, bands);
  check_numbers("nonlinearity_distortion", test.distortion, n_c, bands);
  if (test.settled_p_value.size() > 0 &&
      (test.settled_p_value.size() != bands || !test.settled_p_value.allFinite()))
    refuse("nonlinearity_settled_p_value", "expected one probability per band");
  const Eigen::Index rows = frf.n_outputs() * std::ssize(frf.detection.groups);
  for (const DetectedDistortion* kind : {&test.even, &test.odd}) {
    const char* dataset = kind == &test.even ? "nonlinearity_even" : "nonlinearity_odd";
    check_optional(dataset, kind->p_value, rows, bands);
    check_optional(dataset, kind->level, rows, bands);
  }
}

}  // namespace

void check(const FrfEstimate& frf) {
  check_names("inputs", frf.inputs);
  check_names("outputs", frf.outputs);
  check_scalars(frf);
  check_frequencies(frf);

  const Eigen::Index n_channels = frf.n_outputs() * frf.n_inputs();
  check_shape("response", frf.response, n_channels, frf.lines());
  const auto [first, count] = frf.own();
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    for (Eigen::Index c = first; c < first + count; ++c)
      if (!Eigen::numext::isfinite(frf.response(c, k)))
        refuse(entry_place("response", frf, c, k), "not finite");
  check_variance("noise_variance", frf, frf.noise_variance);
  check_variance("total_variance", frf, frf.total_variance);
  const Eigen::Index n_residuals = frf.n_outputs() * frf.n_outputs();
  check_optional("residual_covariance", frf.residual_covariance, n_residuals, frf.lines());
  check_optional("input_factor", frf.input_factor, frf.n_inputs() * frf.n_inputs(), frf.lines());
  check_optional("covariance", frf.covariance, n_channels * n_channels, frf.lines());
  check_optional("input_condition", frf.input_condition.transpose(), 1, frf.lines());
  check_optional("interpolation_misfit", frf.interpolation_misfit.transpose(), 1, frf.lines());
  check_detection(frf);
  check_nonlinearity(frf);
  if (frf.excluded_power.size() != std::ssize(frf.excluded_channels)) {
    refuse("excluded_power", fmt::format("{} values for {} channels; give one per channel",
                                         frf.excluded_power.size(), frf.excluded_channels.size()));
  }
  if (!frf.excluded_power.allFinite()) refuse("excluded_power", "not finite");
}

}  // namespace stageid
