#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <stdexcept>

#include "tools/plot/response_pictures.hpp"

namespace stageid {
namespace {

/// The first curves, which show the modes, are dark and bold; curves of similar brightness differ by dashes.
constexpr std::array kCurves = {
    "lc rgb '#0b3c7d' lw 1.0",          "lc rgb '#d55e00' lw 0.9",
    "lc rgb '#35a07a' lw 0.8 dt (6,2)", "lc rgb '#b07cc6' lw 0.8",
    "lc rgb '#505050' lw 0.7 dt (2,2)", "lc rgb '#c8a040' lw 0.7 dt (8,2,2,2)"};

constexpr const char* kModeLine = "lw 0.5 dt (1,2) lc rgb '#606060'";
constexpr const char* kRing = "pt 6 ps 0.45 * point lw 0.6 lc rgb 'black'";

/// " [(m/(N s²))²]" if all elements have the same unit.
std::string unit_of(const FrfEstimate& frf) {
  const std::set<std::string> outputs(frf.outputs.units.begin(), frf.outputs.units.end());
  const std::set<std::string> inputs(frf.inputs.units.begin(), frf.inputs.units.end());
  if (outputs.size() != 1 || inputs.size() != 1 || outputs.begin()->empty() ||
      inputs.begin()->empty())
    return "";
  return fmt::format(" [({}/({} s²))²]", *outputs.begin(), *inputs.begin());
}

/// The line nearest to a frequency, as on the page.
Eigen::Index nearest_line(const Eigen::VectorXd& frequency_hz, double hz) {
  const auto above = std::ranges::lower_bound(frequency_hz, hz);
  Eigen::Index k = std::min<Eigen::Index>(above - frequency_hz.begin(), frequency_hz.size() - 1);
  if (k > 0 && hz - frequency_hz[k - 1] < frequency_hz[k] - hz) --k;
  return k;
}

bool inside(const FrfEstimate& frf, double hz) {
  return hz >= frf.frequency_hz[0] && hz <= frf.frequency_hz[frf.lines() - 1];
}

/// Frequencies of the candidates and the values of their curves.
std::array<Eigen::VectorXd, 2> rings(const ReportData& data) {
  std::vector<double> at_hz;
  std::vector<double> value;
  for (const ModeCandidate& mode : data.chosen_modes) {
    if (!inside(*data.frf, mode.frequency_hz)) continue;
    const Eigen::Index curve =
        std::clamp<Eigen::Index>(mode.cmif_curve, 1, data.cmif_curves.rows()) - 1;
    at_hz.push_back(mode.frequency_hz);
    value.push_back(
        data.cmif_curves(curve, nearest_line(data.frf->frequency_hz, mode.frequency_hz)));
  }
  const auto size = static_cast<Eigen::Index>(at_hz.size());
  return {Eigen::Map<Eigen::VectorXd>(at_hz.data(), size),
          Eigen::Map<Eigen::VectorXd>(value.data(), size)};
}

/// Vertical lines at the modes of the model, and their number.
std::pair<std::string, int> mode_lines(const ReportData& data) {
  std::string script;
  int count = 0;
  if (!data.model) return {script, count};
  for (const Submodel& submodel : data.model->submodels) {
    if (!submodel.is_mode() || !inside(*data.frf, submodel.natural_frequency_hz())) continue;
    script += fmt::format("set arrow from first {0},graph 0 to first {0},graph 1 nohead back {1}\n",
                          submodel.natural_frequency_hz(), kModeLine);
    ++count;
  }
  return {script, count};
}

}  // namespace

Picture cmif_picture(const ReportData& data, const PictureStyle& style) {
  if (!data.frf || data.cmif_curves.size() == 0)
    throw std::invalid_argument("cmif: needs a frequency response");
  const FrfEstimate& frf = *data.frf;
  std::vector<std::pair<std::string, Eigen::VectorXd>> columns = {
      {"frequency_hz", frf.frequency_hz}};
  std::string drawn;
  std::vector<LegendEntry> names;
  for (Eigen::Index i = 0; i < data.cmif_curves.rows(); ++i) {
    columns.emplace_back(fmt::format("curve_{}", i + 1), data.cmif_curves.row(i));
    const char* const curve = kCurves[static_cast<std::size_t>(i) % kCurves.size()];
    drawn += fmt::format("{}'cmif.txt' using 1:{} with lines {}", i > 0 ? ", \\\n     " : "", i + 2,
                         curve);
    names.push_back({fmt::format("lines {}", curve), fmt::format("σ@_{}^2", i + 1), 2});
  }
  Picture picture = sized_picture(style, kColumn_in, 2.5);
  picture.tables = {{"cmif.txt", table_text(columns)}};
  const auto [lines, modes] = mode_lines(data);
  const auto [ring_hz, ring_value] = rings(data);
  std::vector<LegendEntry> marks;
  if (modes > 0)
    marks.push_back(
        {fmt::format("lines {}", kModeLine), fmt::format("modes of the model ({})", modes), 23});
  if (ring_hz.size() > 0) {
    picture.tables.push_back(
        {"modes.txt", table_text({{"frequency_hz", ring_hz}, {"value", ring_value}})});
    drawn += fmt::format(", \\\n     'modes.txt' using 1:2 with points {}", kRing);
    marks.push_back(
        {fmt::format("points {}", kRing), fmt::format("candidates ({})", ring_hz.size()), 15});
  }
  picture.script = panel_column(picture, frf.frequency_hz,
                                {magnitude_range(data.cmif_curves),
                                 "CMIF of ω²G" + unit_of(frf),
                                 fmt::format("{}plot {}\n", lines, drawn),
                                 "",
                                 {names, marks}});
  return picture;
}

}  // namespace stageid
