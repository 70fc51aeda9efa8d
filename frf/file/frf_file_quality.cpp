#include "frf/file/frf_file_quality.hpp"

#include <array>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_error.hpp"
#include "frf/file/line_datasets.hpp"

namespace stageid {
namespace {

constexpr double kLargestCount = 1e8;

void write_detection(Hdf5File& file, const DetectionLines& lines, Eigen::Index n_y) {
  if (lines.line.size() == 0) return;
  const std::vector<long long> line(lines.line.begin(), lines.line.end());
  write_known(file, "/detection_frequency_hz", lines.frequency_hz);
  write_vector(file, "/detection_line", line);
  file.write_texts("/detection_groups", lines.groups);
  write_known(file, "/detection_runs", lines.runs);
  write_columns(file, "/detection_power", lines.power, n_y);
  write_matrix(file, "/detection_noise", lines.noise.transpose());
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
    throw FormatError(file.path(), "/detection_line", "DFT lines must be counts (0, 1, 2, ...)");
  lines.line = line.cast<int>();
  lines.groups = file.read_texts("/detection_groups");
  const auto n_g = std::ssize(lines.groups);
  if (n_g == 0) throw FormatError(file.path(), "/detection_groups", "no groups; name at least one");
  lines.runs = read_vector(file, "/detection_runs");
  require_shape(file, "/detection_power", {size_of(D), size_of(n_y), size_of(n_g)});
  lines.power = from_c_order(file.read_reals("/detection_power"), n_y, n_g);
  require_shape(file, "/detection_noise", {size_of(D), size_of(n_y)});
  lines.noise = from_c_order(file.read_reals("/detection_noise"), n_y, 1);
  if (file.has_attribute("/detection_noise", "dof"))
    lines.noise_dof = file.read_real_attribute("/detection_noise", "dof");
  lines.linear_power = read_columns(file, "/detection_linear_power", frf.lines(), n_y, n_g);
}

void write_nonlinearity(Hdf5File& file, const NonlinearityTest& test, Eigen::Index n_y) {
  if (test.band_hz.size() == 0) return;
  write_matrix(file, "/nonlinearity_band_hz", test.band_hz);
  write_columns(file, "/nonlinearity_p_value", test.p_value, n_y);
  write_columns(file, "/nonlinearity_distortion", test.distortion, n_y);
  write_known(file, "/nonlinearity_settled_p_value", test.settled_p_value);
  write_columns(file, "/nonlinearity_even_p_value", test.even.p_value, n_y);
  write_columns(file, "/nonlinearity_even_level", test.even.level, n_y);
  write_columns(file, "/nonlinearity_odd_p_value", test.odd.p_value, n_y);
  write_columns(file, "/nonlinearity_odd_level", test.odd.level, n_y);
}

void read_nonlinearity(const Hdf5File& file, FrfEstimate& frf) {
  if (!file.exists("/nonlinearity_band_hz")) return;
  NonlinearityTest& test = frf.nonlinearity;
  const std::vector<hsize_t> shape = file.shape("/nonlinearity_band_hz");
  if (shape.size() != 2 || shape[0] == 0 || shape[1] != 2)
    fail_format(file.path(), "/nonlinearity_band_hz",
                "shape is {}; expected two frequencies per band", join_shape(shape));
  test.band_hz = from_c_order(file.read_reals("/nonlinearity_band_hz"), 1, 2).transpose();
  const Eigen::Index bands = test.band_hz.rows();
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_u = frf.n_inputs();
  const auto n_g = std::ssize(frf.detection.groups);
  test.p_value = read_columns(file, "/nonlinearity_p_value", bands, n_y, n_u);
  test.distortion = read_columns(file, "/nonlinearity_distortion", bands, n_y, n_u);
  test.settled_p_value = read_known(file, "/nonlinearity_settled_p_value", bands);
  if (n_g == 0) return;
  test.even.p_value = read_columns(file, "/nonlinearity_even_p_value", bands, n_y, n_g);
  test.even.level = read_columns(file, "/nonlinearity_even_level", bands, n_y, n_g);
  test.odd.p_value = read_columns(file, "/nonlinearity_odd_p_value", bands, n_y, n_g);
  test.odd.level = read_columns(file, "/nonlinearity_odd_level", bands, n_y, n_g);
}

/// @throws FormatError if a number is negative or implausibly large
std::vector<double> read_counts(const Hdf5File& file, const std::string& dataset) {
  std::vector<double> counts = file.read_reals(dataset);
  for (const double count : counts) {
    if (!(count >= 0.0 && count <= kLargestCount))
      fail_format(file.path(), dataset, "{} is not a count", count);
  }
  return counts;
}

/// Discarded data: a row of indices each in one dataset, the reasons in another.
template <typename Item, typename IndicesOf>
void write_left_out(Hdf5File& file, const std::vector<Item>& items, const std::string& places,
                    const std::string& reasons, const IndicesOf& indices_of) {
  if (items.empty()) return;
  std::vector<long long> rows;
  std::vector<std::string> texts;
  for (const Item& item : items) {
    for (const int index : indices_of(item)) rows.push_back(index);
    texts.push_back(item.reason);
  }
  std::vector<hsize_t> shape = {items.size()};
  if (rows.size() > items.size()) shape.push_back(rows.size() / items.size());
  file.write_integers(places, shape, rows.data());
  file.write_texts(reasons, texts);
}

/// Calls add(indices, reason) for each; not at all if the datasets are missing.
template <typename Add>
void read_left_out(const Hdf5File& file, const std::string& places, const std::string& reasons,
                   std::size_t columns, const Add& add) {
  if (!file.exists(places)) return;
  const std::vector<std::string> texts = file.read_texts(reasons);
  std::vector<hsize_t> shape = {texts.size()};
  if (columns > 1) shape.push_back(columns);
  require_shape(file, places, shape);
  const std::vector<double> counts = read_counts(file, places);
  for (std::size_t i = 0; i < texts.size(); ++i) {
    const auto row = counts.begin() + static_cast<std::ptrdiff_t>(columns * i);
    add(std::vector<int>(row, row + static_cast<std::ptrdiff_t>(columns)), texts[i]);
  }
}

}  // namespace

void write_quality(Hdf5File& file, const FrfEstimate& frf) {
  write_detection(file, frf.detection, frf.n_outputs());
  write_nonlinearity(file, frf.nonlinearity, frf.n_outputs());
  write_left_out(file, frf.dropped_periods, "/dropped_periods", "/dropped_reasons",
                 [](const DroppedPeriod& one) {
                   return std::array{one.realization, one.experiment, one.period};
                 });
  write_left_out(
      file, frf.replaced_samples, "/replaced_samples", "/replaced_reasons",
      [](const ReplacedSamples& one) {
        return std::array{one.realization, one.experiment, one.period, one.first, one.samples};
      });
  write_left_out(file, frf.left_out_realizations, "/left_out_realizations", "/left_out_reasons",
                 [](const LeftOutRealization& one) { return std::array{one.realization}; });
}

void read_quality(const Hdf5File& file, FrfEstimate& frf) {
  read_detection(file, frf);
  read_nonlinearity(file, frf);
  read_left_out(file, "/dropped_periods", "/dropped_reasons", 3,
                [&](const std::vector<int>& at, const std::string& reason) {
                  frf.dropped_periods.push_back({at[0], at[1], at[2], reason});
                });
  read_left_out(file, "/replaced_samples", "/replaced_reasons", 5,
                [&](const std::vector<int>& at, const std::string& reason) {
                  frf.replaced_samples.push_back({at[0], at[1], at[2], at[3], at[4], reason});
                });
  read_left_out(file, "/left_out_realizations", "/left_out_reasons", 1,
                [&](const std::vector<int>& at, const std::string& reason) {
                  frf.left_out_realizations.push_back({at[0], reason});
                });
}

}  // namespace stageid
