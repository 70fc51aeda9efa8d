#include "frf/frf_estimate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <stdexcept>

namespace stageid {
namespace {

using Indices = std::vector<Eigen::Index>;

/// Where each of `wanted` stands in `channels`.
Indices positions(const ChannelList& channels, const std::vector<std::string>& wanted,
                  const char* kind) {
  if (wanted.empty()) {
    throw std::invalid_argument(
        fmt::format("select_channels: no {} asked for; name at least one", kind));
  }
  Indices found;
  for (const std::string& name : wanted) {
    const auto at = std::find(channels.names.begin(), channels.names.end(), name);
    if (at == channels.names.end()) {
      throw std::invalid_argument(fmt::format("select_channels: unknown {} '{}'; there are {}",
                                              kind, name, fmt::join(channels.names, ", ")));
    }
    found.push_back(at - channels.names.begin());
  }
  if (std::set<Eigen::Index>(found.begin(), found.end()).size() != found.size()) {
    throw std::invalid_argument(
        fmt::format("select_channels: an {} is named twice; name each once", kind));
  }
  return found;
}

ChannelList pick(const ChannelList& channels, const Indices& at) {
  ChannelList picked;
  for (const Eigen::Index i : at) {
    picked.names.push_back(channels.names[static_cast<std::size_t>(i)]);
    picked.units.push_back(channels.units[static_cast<std::size_t>(i)]);
  }
  return picked;
}

/// Rows of a matrix whose empty form (unknown) stays empty.
template <typename Matrix>
Matrix rows_or_empty(const Matrix& matrix, const Indices& rows) {
  return matrix.size() == 0 ? Matrix() : Matrix(matrix(rows, Eigen::all));
}

/// Rows of columns that are vec of a square matrix, for the given rows and columns of that matrix.
Indices square_rows(const Indices& kept, Eigen::Index size) {
  Indices rows;
  for (const Eigen::Index column : kept) {
    for (const Eigen::Index row : kept) rows.push_back(row + size * column);
  }
  return rows;
}

[[noreturn]] void refuse(const std::string& place, const std::string& wrong) {
  throw std::invalid_argument(place + ": " + wrong);
}

void check_names(const char* place, const ChannelList& channels) {
  if (channels.names.empty()) refuse(place, "no channel; name at least one");
  if (channels.units.size() != channels.names.size()) {
    refuse(place, fmt::format("{} units for {} channels; give one a channel", channels.units.size(),
                              channels.names.size()));
  }
  std::set<std::string> seen;
  for (const std::string& name : channels.names) {
    if (!seen.insert(name).second) {
      refuse(place, fmt::format("'{}' stands there twice; channel names must differ", name));
    }
  }
}

void check_frequencies(const FrfEstimate& frf) {
  const Eigen::VectorXd& f = frf.frequency_hz;
  if (f.size() == 0) refuse("frequency_hz", "no line; give at least one");
  for (Eigen::Index k = 0; k < f.size(); ++k) {
    const std::string place = fmt::format("frequency_hz[line {}]", k);
    if (!std::isfinite(f[k]) || f[k] < 0.0) {
      refuse(place, "not a finite number >= 0");
    }
    if (k > 0 && !(f[k] > f[k - 1])) {
      refuse(place,
             fmt::format("{} Hz after {} Hz; frequencies must increase strictly", f[k], f[k - 1]));
    }
  }
  const double last = f[f.size() - 1];
  if (frf.hold == Hold::zoh && frf.sample_rate_hz > 0.0 && last > 0.5 * frf.sample_rate_hz) {
    refuse(fmt::format("frequency_hz[line {}]", f.size() - 1),
           fmt::format("{} Hz is above half the sample rate of {} Hz", last, frf.sample_rate_hz));
  }
}

bool is_finite(double value) { return std::isfinite(value); }
bool is_finite(const std::complex<double>& value) {
  return std::isfinite(value.real()) && std::isfinite(value.imag());
}

std::string entry_place(const char* dataset, const FrfEstimate& frf, Eigen::Index c,
                        Eigen::Index k) {
  return fmt::format("{}[line {}, {} <- {}]", dataset, k,
                     frf.outputs.names[static_cast<std::size_t>(c % frf.n_outputs())],
                     frf.inputs.names[static_cast<std::size_t>(c / frf.n_outputs())]);
}

template <typename Matrix>
void check_shape(const char* dataset, const Matrix& matrix, Eigen::Index rows, Eigen::Index lines) {
  if (matrix.rows() != rows || matrix.cols() != lines) {
    refuse(dataset, fmt::format("{} values on {} lines; {} on {} belong there", matrix.rows(),
                                matrix.cols(), rows, lines));
  }
}

void check_variance(const char* dataset, const FrfEstimate& frf, const Eigen::MatrixXd& variance) {
  if (variance.size() == 0) return;
  check_shape(dataset, variance, frf.n_outputs() * frf.n_inputs(), frf.lines());
  for (Eigen::Index k = 0; k < variance.cols(); ++k) {
    for (Eigen::Index c = 0; c < variance.rows(); ++c) {
      if (!is_finite(variance(c, k))) refuse(entry_place(dataset, frf, c, k), "not finite");
      if (variance(c, k) < 0.0)
        refuse(entry_place(dataset, frf, c, k), "a variance is not negative");
    }
  }
}

/// An optional dataset of numbers without channel names to speak of.
template <typename Matrix>
void check_optional(const char* dataset, const Matrix& matrix, Eigen::Index rows,
                    Eigen::Index lines) {
  if (matrix.size() == 0) return;
  check_shape(dataset, matrix, rows, lines);
  for (Eigen::Index k = 0; k < matrix.cols(); ++k) {
    for (Eigen::Index c = 0; c < matrix.rows(); ++c) {
      if (!is_finite(matrix(c, k))) refuse(fmt::format("{}[line {}]", dataset, k), "not finite");
    }
  }
}

void check_scalars(const FrfEstimate& frf) {
  if (!std::isfinite(frf.sample_rate_hz) || frf.sample_rate_hz < 0.0) {
    refuse("sample_rate_hz", "not a finite number >= 0; 0 means unknown");
  }
  if (!std::isfinite(frf.delay_s)) refuse("delay_s", "not finite");
  for (const double dof : {frf.noise_dof, frf.total_dof}) {
    if (!std::isfinite(dof) || dof < 0.0)
      refuse("noise_dof, total_dof", "not a finite number >= 0");
  }
}

}  // namespace

Eigen::VectorXd FrfEstimate::omega_rad_s() const { return 2.0 * std::numbers::pi * frequency_hz; }

Eigen::Map<const Eigen::MatrixXcd> FrfEstimate::at(Eigen::Index k) const {
  return {response.col(k).data(), n_outputs(), n_inputs()};
}

FrfEstimate select_band(const FrfEstimate& frf, double low_hz, double high_hz) {
  Indices kept;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    if (frf.frequency_hz[k] >= low_hz && frf.frequency_hz[k] <= high_hz) kept.push_back(k);
  }
  if (kept.empty()) {
    const std::string range = frf.lines() == 0
                                  ? std::string("no lines")
                                  : fmt::format("lines from {} to {} Hz", frf.frequency_hz[0],
                                                frf.frequency_hz[frf.lines() - 1]);
    throw std::invalid_argument(
        fmt::format("band {} to {} Hz: no line lies in it; the frequency response has {}", low_hz,
                    high_hz, range));
  }
  const auto columns = [&kept](const auto& matrix) {
    using Matrix = std::decay_t<decltype(matrix)>;
    return matrix.size() == 0 ? Matrix() : Matrix(matrix(Eigen::all, kept));
  };
  FrfEstimate band = frf;
  band.frequency_hz = frf.frequency_hz(kept);
  band.response = columns(frf.response);
  band.noise_variance = columns(frf.noise_variance);
  band.total_variance = columns(frf.total_variance);
  band.residual_covariance_re = columns(frf.residual_covariance_re);
  band.residual_covariance_im = columns(frf.residual_covariance_im);
  band.input_factor = columns(frf.input_factor);
  band.covariance = columns(frf.covariance);
  if (frf.input_condition.size() != 0) band.input_condition = frf.input_condition(kept);
  return band;
}

FrfEstimate select_channels(const FrfEstimate& frf, const std::vector<std::string>& inputs,
                            const std::vector<std::string>& outputs) {
  const Indices input_at = positions(frf.inputs, inputs, "input");
  const Indices output_at = positions(frf.outputs, outputs, "output");
  Indices entries;
  for (const Eigen::Index j : input_at) {
    for (const Eigen::Index i : output_at) entries.push_back(i + frf.n_outputs() * j);
  }
  const Indices residual_rows = square_rows(output_at, frf.n_outputs());

  FrfEstimate part = frf;
  part.inputs = pick(frf.inputs, input_at);
  part.outputs = pick(frf.outputs, output_at);
  part.response = rows_or_empty(frf.response, entries);
  part.noise_variance = rows_or_empty(frf.noise_variance, entries);
  part.total_variance = rows_or_empty(frf.total_variance, entries);
  part.residual_covariance_re = rows_or_empty(frf.residual_covariance_re, residual_rows);
  part.residual_covariance_im = rows_or_empty(frf.residual_covariance_im, residual_rows);
  // The other inputs' estimates are marginalized: a part of S, which is already an inverse.
  part.input_factor = rows_or_empty(frf.input_factor, square_rows(input_at, frf.n_inputs()));
  part.covariance =
      rows_or_empty(frf.covariance, square_rows(entries, frf.n_outputs() * frf.n_inputs()));
  return part;
}

void check(const FrfEstimate& frf) {
  check_names("inputs", frf.inputs);
  check_names("outputs", frf.outputs);
  check_scalars(frf);
  check_frequencies(frf);

  const Eigen::Index n_channels = frf.n_outputs() * frf.n_inputs();
  check_shape("response", frf.response, n_channels, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    for (Eigen::Index c = 0; c < n_channels; ++c) {
      if (!is_finite(frf.response(c, k))) refuse(entry_place("response", frf, c, k), "not finite");
    }
  }
  check_variance("noise_variance", frf, frf.noise_variance);
  check_variance("total_variance", frf, frf.total_variance);
  const Eigen::Index n_residuals = frf.n_outputs() * frf.n_outputs();
  check_optional("residual_covariance", frf.residual_covariance_re, n_residuals, frf.lines());
  check_optional("residual_covariance", frf.residual_covariance_im, n_residuals, frf.lines());
  if (frf.residual_covariance_re.size() != frf.residual_covariance_im.size()) {
    refuse("residual_covariance", "real and imaginary part differ in size");
  }
  check_optional("input_factor", frf.input_factor, frf.n_inputs() * frf.n_inputs(), frf.lines());
  check_optional("covariance", frf.covariance, n_channels * n_channels, frf.lines());
  if (frf.input_condition.size() != 0) {
    check_optional("input_condition", Eigen::MatrixXd(frf.input_condition.transpose()), 1,
                   frf.lines());
  }
  if (frf.excluded_power.size() != static_cast<Eigen::Index>(frf.excluded_channels.size())) {
    refuse("excluded_power", fmt::format("{} values for {} channels", frf.excluded_power.size(),
                                         frf.excluded_channels.size()));
  }
  if (!frf.excluded_power.allFinite()) refuse("excluded_power", "not finite");
}

}  // namespace stageid
