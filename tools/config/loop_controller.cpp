#include "tools/config/loop_controller.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "acquisition/files/fail.hpp"
#include "tools/config/controller_file.hpp"
#include "tools/config/yaml_document.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/exchange/matlab/mat_file.hpp"

namespace stageid {
namespace {

using Matrices = LinearControllerKeys::StateSpace;

constexpr double kSameRate = 1e-9;

void require_rate(const std::filesystem::path& file, double have_hz, double wanted_hz) {
  if (std::abs(have_hz - wanted_hz) > kSameRate * wanted_hz)
    fail_format(file, "",
                "the controller is discrete at {} Hz, the stage runs at {} Hz. Discretize it at "
                "the sample rate of the stage",
                have_hz, wanted_hz);
}

const NamedArray* find_matrix(const ArrayList& list, const std::string& lower,
                              const std::string& upper) {
  const NamedArray* found = list.find(upper);
  return found != nullptr ? found : list.find(lower);
}

/// Row by row. The array must have this shape, or be a vector of as many entries.
std::vector<double> matrix_in(const ArrayList& list, const char* name, const NamedArray& array,
                              std::size_t rows, std::size_t columns) {
  const bool same = array.shape == std::vector<std::size_t>{rows, columns};
  if (!same && (array.shape.size() > 1 || array.size() != rows * columns))
    fail_format(list.file, name,
                "is {}; expected {} x {}. Use the channels of the stage file, in their order",
                fmt::join(array.shape, " x "), rows, columns);
  return real_values(list, array);
}

Matrices named_matrices(const ArrayList& list, const StageInfo& stage) {
  const std::size_t n_u = stage.actuators.size();
  const std::size_t n_y = stage.sensors.size();
  const NamedArray* a = find_matrix(list, "a", "A");
  const NamedArray* b = find_matrix(list, "b", "B");
  const NamedArray* c = find_matrix(list, "c", "C");
  const NamedArray* d = find_matrix(list, "d", "D");
  Matrices out;
  if (a != nullptr || d == nullptr) {
    if (a == nullptr || b == nullptr || c == nullptr)
      throw FormatError(list.file, "",
                        "the arrays A, B and C are required, for a controller without states D. "
                        "Save the matrices of the state space under these names");
    const auto n = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(a->size()))));
    out.a = matrix_in(list, "A", *a, n, n);
    out.b = matrix_in(list, "B", *b, n, n_y);
    out.c = matrix_in(list, "C", *c, n_u, n);
  }
  if (d != nullptr) out.d = matrix_in(list, "D", *d, n_u, n_y);
  for (const char* name : {"Ts", "dt"})
    if (const NamedArray* period = list.find(name); period != nullptr && period->size() == 1)
      require_rate(list.file, 1.0 / real_values(list, *period).front(), stage.sample_rate_hz);
  return out;
}

/// A table of [A B; C D].
Matrices packed_matrices(const ArrayList& list, const StageInfo& stage) {
  const std::size_t n_u = stage.actuators.size();
  const std::size_t n_y = stage.sensors.size();
  const std::size_t columns = list.arrays.size();
  const std::size_t rows = columns == 0 ? 0 : list.arrays.front().size();
  if (columns < n_y || rows != columns - n_y + n_u)
    fail_format(list.file, "",
                "the table has {} rows and {} columns; expected [A B; C D] of n + {} rows and n + "
                "{} columns for n states",
                rows, columns, n_u, n_y);
  const std::size_t n = columns - n_y;
  std::vector<std::vector<double>> table;
  for (const NamedArray& column : list.arrays) {
    table.push_back(real_values(list, column));
    if (table.back().size() != rows)
      throw FormatError(list.file, column.name, "has fewer rows than the first column; fill them");
  }
  Matrices out;
  for (std::size_t row = 0; row < rows; ++row)
    for (std::size_t column = 0; column < columns; ++column) {
      std::vector<double>& part =
          row < n ? (column < n ? out.a : out.b) : (column < n ? out.c : out.d);
      part.push_back(table[column][row]);
    }
  return out;
}

std::vector<std::string> quoted_names(const std::vector<Channel>& channels) {
  std::vector<std::string> names;
  for (const Channel& channel : channels) names.push_back(fmt::format("\"{}\"", channel.name));
  return names;
}

std::string text_of(const Matrices& m, const StageInfo& stage) {
  std::string text = fmt::format(
      "format: stageid-controller\nsensors: [{}]\nactuators: [{}]\nsample_rate_hz: {:.17g}\n"
      "state_space:\n",
      fmt::join(quoted_names(stage.sensors), ", "), fmt::join(quoted_names(stage.actuators), ", "),
      stage.sample_rate_hz);
  for (const auto& [key, values] :
       {std::pair("a", &m.a), std::pair("b", &m.b), std::pair("c", &m.c), std::pair("d", &m.d)})
    if (!values->empty()) text += fmt::format("  {}: [{:.17g}]\n", key, fmt::join(*values, ", "));
  return text;
}

}  // namespace

std::string loop_controller_text(const std::filesystem::path& file, const StageInfo& stage) {
  const std::string ending = file.extension().string();
  if (ending == ".yaml" || ending == ".yml" || ending == ".json")
    return YamlDocument::read(file).text();
  if (ending == ".csv") return text_of(packed_matrices(read_csv(file), stage), stage);
  if (ending == ".mat") return text_of(named_matrices(read_mat(file), stage), stage);
  if (ending == ".npz") return text_of(named_matrices(read_npz(file), stage), stage);
  if (ending == ".h5" || ending == ".hdf5")
    return text_of(named_matrices(read_hdf5_arrays(file), stage), stage);
  throw FormatError(file, "",
                    "unsupported controller file; use 'peer', or a file that ends in .yaml, .json, "
                    ".mat, .npz, .h5 or .csv");
}

LinearControllerKeys parse_loop_controller(const std::filesystem::path& name, std::string text,
                                           double sample_rate_hz) {
  const YamlDocument document = YamlDocument::parse(name, std::move(text));
  double rate_hz = 0.0;
  LinearControllerKeys keys = read_discrete_controller(document, rate_hz);
  require_rate(name, rate_hz, sample_rate_hz);
  return keys;
}

}  // namespace stageid
