#include "frf/frf_file_quality.hpp"

#include <fmt/format.h>

#include "excitation/file_error.hpp"
#include "frf/line_datasets.hpp"

namespace stageid {
namespace {

constexpr double kLargestCount = 1e8;

Eigen::VectorXd read_vector(const Hdf5File& file, const std::string& dataset) {
  const std::vector<hsize_t> shape = file.shape(dataset);
  if (shape.size() != 1) {
    throw FormatError(
        file.path(), dataset,
        fmt::format("shape is {}; a list of numbers belongs there", join_shape(shape)));
  }
  const std::vector<double> values = file.read_reals(dataset);
  return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// (rows * columns) x lines from [lines x rows x columns], or empty if it is not there.
Eigen::MatrixXd read_if_there(const Hdf5File& file, const std::string& dataset, Eigen::Index lines,
                              Eigen::Index rows, Eigen::Index columns) {
  if (!file.exists(dataset)) return {};
  require_shape(file, dataset, {size_of(lines), size_of(rows), size_of(columns)});
  return from_c_order(file.read_reals(dataset), rows, columns);
}

void write_columns(Hdf5File& file, const std::string& dataset, const Eigen::MatrixXd& columns,
                   Eigen::Index rows) {
  if (columns.size() == 0) return;
  file.write_reals(dataset,
                   {size_of(columns.cols()), size_of(rows), size_of(columns.rows() / rows)},
                   to_c_order<double>(columns, rows).data());
}

void write_detection(Hdf5File& file, const DetectionLines& lines, Eigen::Index n_y) {
  if (lines.line.size() == 0) return;
  const std::vector<long long> line(lines.line.begin(), lines.line.end());
  file.write_reals("/detection_frequency_hz", {size_of(lines.line.size())},
                   lines.frequency_hz.data());
  file.write_integers("/detection_line", {line.size()}, line.data());
  file.write_texts("/detection_groups", lines.groups);
  file.write_reals("/detection_runs", {size_of(lines.runs.size())}, lines.runs.data());
  write_columns(file, "/detection_power", lines.power, n_y);
  file.write_reals("/detection_noise", {size_of(lines.noise.cols()), size_of(n_y)},
                   lines.noise.data());
  file.write_attribute("/detection_noise", "dof", lines.noise_dof);
  write_columns(file, "/detection_linear_power", lines.linear_power, n_y);
}

void read_detection(const Hdf5File& file, FrfEstimate& frf) {
  if (!file.exists("/detection_frequency_hz")) return;
  DetectionLines& lines = frf.detection;
  const Eigen::Index n_y = frf.n_outputs();
  lines.frequency_hz = read_vector(file, "/detection_frequency_hz");
  const Eigen::Index D = lines.frequency_hz.size();
  require_shape(file, "/detection_line", {size_of(D)});
  const Eigen::VectorXd line = read_vector(file, "/detection_line");
  if (!((line.array() >= 0.0).all() && (line.array() <= 1e9).all()))
    throw FormatError(file.path(), "/detection_line", "a line of the DFT is a count");
  lines.line = line.cast<int>();
  lines.groups = file.read_texts("/detection_groups");
  const auto n_g = static_cast<Eigen::Index>(lines.groups.size());
  if (n_g == 0) throw FormatError(file.path(), "/detection_groups", "no group; name at least one");
  lines.runs = read_vector(file, "/detection_runs");
  require_shape(file, "/detection_power", {size_of(D), size_of(n_y), size_of(n_g)});
  lines.power = from_c_order(file.read_reals("/detection_power"), n_y, n_g);
  require_shape(file, "/detection_noise", {size_of(D), size_of(n_y)});
  lines.noise = from_c_order(file.read_reals("/detection_noise"), n_y, 1);
  if (file.has_attribute("/detection_noise", "dof"))
    lines.noise_dof = file.read_real_attribute("/detection_noise", "dof");
  lines.linear_power = read_if_there(file, "/detection_linear_power", frf.lines(), n_y, n_g);
}

void write_nonlinearity(Hdf5File& file, const NonlinearityTest& test, Eigen::Index n_y) {
  if (test.band_hz.size() == 0) return;
  file.write_reals("/nonlinearity_band_hz", {size_of(test.band_hz.rows()), 2},
                   Eigen::MatrixXd(test.band_hz.transpose()).data());
  write_columns(file, "/nonlinearity_p_value", test.p_value, n_y);
  write_columns(file, "/nonlinearity_distortion", test.distortion, n_y);
  write_columns(file, "/nonlinearity_even_p_value", test.even.p_value, n_y);
  write_columns(file, "/nonlinearity_even_level", test.even.level, n_y);
  write_columns(file, "/nonlinearity_odd_p_value", test.odd.p_value, n_y);
  write_columns(file, "/nonlinearity_odd_level", test.odd.level, n_y);
}

void read_nonlinearity(const Hdf5File& file, FrfEstimate& frf) {
  if (!file.exists("/nonlinearity_band_hz")) return;
  NonlinearityTest& test = frf.nonlinearity;
  const std::vector<hsize_t> shape = file.shape("/nonlinearity_band_hz");
  if (shape.size() != 2 || shape[0] == 0 || shape[1] != 2) {
    throw FormatError(
        file.path(), "/nonlinearity_band_hz",
        fmt::format("shape is {}; two frequencies a band belong there", join_shape(shape)));
  }
  test.band_hz = from_c_order(file.read_reals("/nonlinearity_band_hz"), 1, 2).transpose();
  const Eigen::Index bands = test.band_hz.rows();
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_u = frf.n_inputs();
  const auto n_g = static_cast<Eigen::Index>(frf.detection.groups.size());
  test.p_value = read_if_there(file, "/nonlinearity_p_value", bands, n_y, n_u);
  test.distortion = read_if_there(file, "/nonlinearity_distortion", bands, n_y, n_u);
  if (n_g == 0) return;
  test.even.p_value = read_if_there(file, "/nonlinearity_even_p_value", bands, n_y, n_g);
  test.even.level = read_if_there(file, "/nonlinearity_even_level", bands, n_y, n_g);
  test.odd.p_value = read_if_there(file, "/nonlinearity_odd_p_value", bands, n_y, n_g);
  test.odd.level = read_if_there(file, "/nonlinearity_odd_level", bands, n_y, n_g);
}

/// @throws FormatError if a number is negative or beyond what anybody measures
std::vector<double> read_counts(const Hdf5File& file, const std::string& dataset) {
  std::vector<double> counts = file.read_reals(dataset);
  for (const double count : counts) {
    if (!(count >= 0.0 && count <= kLargestCount))
      throw FormatError(file.path(), dataset, fmt::format("{} is not a count", count));
  }
  return counts;
}

void write_dropped(Hdf5File& file, const std::vector<DroppedPeriod>& dropped) {
  if (dropped.empty()) return;
  std::vector<long long> where;
  std::vector<std::string> reasons;
  for (const DroppedPeriod& period : dropped) {
    where.insert(where.end(), {period.realization, period.experiment, period.period});
    reasons.push_back(period.reason);
  }
  file.write_integers("/dropped_periods", {dropped.size(), 3}, where.data());
  file.write_texts("/dropped_reasons", reasons);
}

void read_dropped(const Hdf5File& file, std::vector<DroppedPeriod>& dropped) {
  if (!file.exists("/dropped_periods")) return;
  const std::vector<std::string> reasons = file.read_texts("/dropped_reasons");
  require_shape(file, "/dropped_periods", {reasons.size(), 3});
  const std::vector<double> where = read_counts(file, "/dropped_periods");
  for (std::size_t i = 0; i < reasons.size(); ++i) {
    const auto number = [&](std::size_t column) { return static_cast<int>(where[3 * i + column]); };
    dropped.push_back({number(0), number(1), number(2), reasons[i]});
  }
}

void write_left_out(Hdf5File& file, const std::vector<LeftOutRealization>& left_out) {
  if (left_out.empty()) return;
  std::vector<long long> which;
  std::vector<std::string> reasons;
  for (const LeftOutRealization& one : left_out) {
    which.push_back(one.realization);
    reasons.push_back(one.reason);
  }
  file.write_integers("/left_out_realizations", {which.size()}, which.data());
  file.write_texts("/left_out_reasons", reasons);
}

void read_left_out(const Hdf5File& file, std::vector<LeftOutRealization>& left_out) {
  if (!file.exists("/left_out_realizations")) return;
  const std::vector<std::string> reasons = file.read_texts("/left_out_reasons");
  require_shape(file, "/left_out_realizations", {reasons.size()});
  const std::vector<double> which = read_counts(file, "/left_out_realizations");
  for (std::size_t i = 0; i < reasons.size(); ++i)
    left_out.push_back({static_cast<int>(which[i]), reasons[i]});
}

}  // namespace

void write_quality(Hdf5File& file, const FrfEstimate& frf) {
  write_detection(file, frf.detection, frf.n_outputs());
  write_nonlinearity(file, frf.nonlinearity, frf.n_outputs());
  write_dropped(file, frf.dropped_periods);
  write_left_out(file, frf.left_out_realizations);
}

void read_quality(const Hdf5File& file, FrfEstimate& frf) {
  read_detection(file, frf);
  read_nonlinearity(file, frf);
  read_dropped(file, frf.dropped_periods);
  read_left_out(file, frf.left_out_realizations);
}

}  // namespace stageid
