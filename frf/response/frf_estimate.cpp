#include "frf/response/frf_estimate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "acquisition/files/fail.hpp"
#include "frf/response/channel_positions.hpp"
#include "frf/response/channel_tiles.hpp"

namespace stageid {
namespace {

using Indices = std::vector<Eigen::Index>;

Indices positions(const ChannelList& channels, const std::vector<std::string>& wanted,
                  const char* option, const char* kind) {
  if (wanted.empty()) fail_request("no {} selected; name at least one", kind);
  return channel_positions(channels, wanted, option, kind);
}

/// Selects rows of a matrix; an empty one (unknown) remains empty.
template <typename Matrix>
Matrix rows_or_empty(const Matrix& matrix, const Indices& rows) {
  return matrix.size() == 0 ? Matrix() : Matrix(matrix(rows, Eigen::all));
}

/// Keeps columns of a matrix, within its own memory; an empty one (unknown) remains empty.
/// @param rows those that are copied: others are not written
template <typename Matrix>
void keep_columns(Matrix& matrix, const DataRange& lines, DataRange rows) {
  if (matrix.size() == 0) return;
  for (Eigen::Index k = 0; lines.first > 0 && k < lines.count; ++k)
    matrix.col(k).segment(rows.first, rows.count) =
        matrix.col(lines.first + k).segment(rows.first, rows.count);
  matrix.conservativeResize(Eigen::NoChange, lines.count);
}

/// Indices into vec(square matrix) for the given rows and columns of that matrix.
Indices square_rows(const Indices& kept, Eigen::Index size) {
  Indices rows;
  for (const Eigen::Index column : kept) {
    for (const Eigen::Index row : kept) rows.push_back(row + size * column);
  }
  return rows;
}

/// Selects the rows output + n_y * group of the kept outputs in all data of the detection lines.
void select_detection(const FrfEstimate& frf, const Indices& outputs, FrfEstimate& part) {
  Indices rows;
  for (std::size_t g = 0; g < frf.detection.groups.size(); ++g) {
    for (const Eigen::Index i : outputs)
      rows.push_back(i + frf.n_outputs() * static_cast<Eigen::Index>(g));
  }
  part.detection.power = rows_or_empty(frf.detection.power, rows);
  part.detection.noise = rows_or_empty(frf.detection.noise, outputs);
  part.detection.linear_power = rows_or_empty(frf.detection.linear_power, rows);
  for (const auto kind : {&NonlinearityTest::even, &NonlinearityTest::odd}) {
    (part.nonlinearity.*kind).p_value = rows_or_empty((frf.nonlinearity.*kind).p_value, rows);
    (part.nonlinearity.*kind).level = rows_or_empty((frf.nonlinearity.*kind).level, rows);
  }
}

}  // namespace

Eigen::VectorXd FrfEstimate::omega_rad_s() const { return 2.0 * std::numbers::pi * frequency_hz; }

Eigen::Map<const Eigen::MatrixXcd> FrfEstimate::at(Eigen::Index k) const {
  return {response.col(k).data(), n_outputs(), n_inputs()};
}

ChannelData::ChannelData() : team(&Team::one()) {}

ChannelData::ChannelData(const ChannelData& other)
    : response(with_rows(other.response, other.own())),
      noise_variance(with_rows(other.noise_variance, other.own())),
      total_variance(with_rows(other.total_variance, other.own())),
      team(other.team) {}

DataRange ChannelData::own() const { return own_channels(*team, response.rows()); }

bool ChannelData::any(bool of_own_rows) const {
  return team->divides(channel_tiles(response.rows())) ? team->any(of_own_rows) : of_own_rows;
}

FrfEstimate select_band(FrfEstimate frf, double low_hz, double high_hz) {
  if (low_hz > high_hz)
    fail_request("band {} to {} Hz is reversed; write the lower frequency first", low_hz, high_hz);
  const auto* const begin = frf.frequency_hz.data();
  const auto* const end = begin + frf.lines();
  const Eigen::Index first = std::lower_bound(begin, end, low_hz) - begin;
  const bool is_band = low_hz <= high_hz;  // neither end is NaN
  const Eigen::Index kept = is_band ? std::upper_bound(begin, end, high_hz) - begin - first : 0;
  if (kept == 0) {
    const std::string range = frf.lines() == 0
                                  ? std::string("no lines")
                                  : fmt::format("lines from {} to {} Hz", frf.frequency_hz[0],
                                                frf.frequency_hz[frf.lines() - 1]);
    fail_request("band {} to {} Hz contains no lines; the frequency response has {}", low_hz,
                 high_hz, range);
  }
  const DataRange lines{first, kept};
  const DataRange own = frf.own();
  keep_columns(frf.response, lines, own);
  for (Eigen::MatrixXd* const columns : {&frf.noise_variance, &frf.total_variance})
    keep_columns(*columns, lines, own);
  for (Eigen::MatrixXcd* const columns :
       {&frf.residual_covariance, &frf.input_factor, &frf.covariance})
    keep_columns(*columns, lines, {0, columns->rows()});
  Eigen::MatrixXd& power = frf.detection.linear_power;
  keep_columns(power, lines, {0, power.rows()});
  for (Eigen::VectorXd* const of_lines :
       {&frf.input_condition, &frf.interpolation_misfit, &frf.frequency_hz}) {
    if (of_lines->size() != 0) *of_lines = of_lines->segment(lines.first, lines.count).eval();
  }
  return frf;
}

Eigen::MatrixXcd output_covariance(const FrfEstimate& frf, Eigen::Index k) {
  return frf.residual_covariance.col(k).reshaped(frf.n_outputs(), frf.n_outputs());
}

FrfEstimate select_channels(FrfEstimate frf, const std::vector<std::string>& inputs,
                            const std::vector<std::string>& outputs) {
  if (frf.inputs.names == inputs && frf.outputs.names == outputs) return frf;
  const Indices input_at = positions(frf.inputs, inputs, "inputs", "input");
  const Indices output_at = positions(frf.outputs, outputs, "outputs", "output");
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
  part.residual_covariance = rows_or_empty(frf.residual_covariance, residual_rows);
  // The other inputs are marginalized by taking a part of S, which is an inverse already.
  part.input_factor = rows_or_empty(frf.input_factor, square_rows(input_at, frf.n_inputs()));
  part.covariance =
      rows_or_empty(frf.covariance, square_rows(entries, frf.n_outputs() * frf.n_inputs()));
  part.nonlinearity.p_value = rows_or_empty(frf.nonlinearity.p_value, entries);
  part.nonlinearity.distortion = rows_or_empty(frf.nonlinearity.distortion, entries);
  select_detection(frf, output_at, part);
  return part;
}

}  // namespace stageid
