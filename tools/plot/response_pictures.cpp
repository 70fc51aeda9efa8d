#include "tools/plot/response_pictures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "acquisition/files/fail.hpp"
#include "tools/report/report_uncertainty.hpp"

namespace stageid {
namespace {

// Colours that also differ in brightness, for print in grey; widths in pt, `point` is one unit of symbol size.
constexpr const char* kMeasuredColour = "lc rgb '#f0a030'";
constexpr const char* kModelColour = "lc rgb '#0b3c7d'";
constexpr const char* kResidualColour = "lc rgb '#8c8c8c' pt 7";
constexpr const char* kDeviationLine = "lines lc rgb '#202020' lw 0.8";

constexpr Eigen::Index kMostRowsOrColumns = 40;

const FrfEstimate& response_of(const ReportData& data, const char* figure) {
  if (!data.frf) fail_request("{}: needs a frequency response", figure);
  return *data.frf;
}

std::string unit_of(const ChannelList& channels, Eigen::Index i) {
  const auto at = static_cast<std::size_t>(i);
  return at < channels.units.size() && !channels.units[at].empty() ? channels.units[at] : "1";
}

/// "m/N" if all of these elements have the same unit, else empty.
std::string common_unit(const FrfEstimate& frf, const std::vector<Eigen::Index>& outputs,
                        const std::vector<Eigen::Index>& inputs) {
  const std::string output = unit_of(frf.outputs, outputs.at(0));
  const std::string input = unit_of(frf.inputs, inputs.at(0));
  for (const Eigen::Index i : outputs)
    if (unit_of(frf.outputs, i) != output) return "";
  for (const Eigen::Index j : inputs)
    if (unit_of(frf.inputs, j) != input) return "";
  return output + "/" + input;
}

struct ElementTable {
  std::vector<std::pair<std::string, Eigen::VectorXd>> columns;
  int model = 0, residual = 0, deviation = 0;  ///< columns counted from 1; 0: missing

  int add(const char* name, const Eigen::VectorXd& values) {
    columns.emplace_back(name, values);
    return static_cast<int>(columns.size());
  }
};

ElementTable element_table(const ReportData& data, Eigen::Index channel, bool with_errors) {
  const FrfEstimate& frf = *data.frf;
  ElementTable table;
  table.add("frequency_hz", frf.frequency_hz);
  table.add("measured", frf.response.row(channel).cwiseAbs());
  if (data.model_response.size() > 0) {
    table.model = table.add("model", data.model_response.row(channel).cwiseAbs());
    if (with_errors)
      table.residual = table.add(
          "residual", (frf.response.row(channel) - data.model_response.row(channel)).cwiseAbs());
  }
  const Eigen::MatrixXd* const variance = report::uncertainty(frf).variance;
  if (with_errors && variance != nullptr)
    table.deviation = table.add("deviation", variance->row(channel).cwiseSqrt());
  return table;
}

/// Phases in degrees; the curve ends and begins anew where it passes 180.
Eigen::VectorXd phases_of(const Eigen::MatrixXcd& response, Eigen::Index channel) {
  Eigen::VectorXd degrees = response.row(channel).cwiseArg() * (180.0 / std::numbers::pi);
  for (Eigen::Index k = degrees.size() - 1; k > 0; --k)
    if (std::abs(degrees[k] - degrees[k - 1]) > 180.0) degrees[k] = std::nan("");
  return degrees;
}

ElementTable phase_table(const ReportData& data, Eigen::Index channel) {
  ElementTable table;
  table.add("frequency_hz", data.frf->frequency_hz);
  table.add("measured_deg", phases_of(data.frf->response, channel));
  if (data.model_response.size() > 0)
    table.model = table.add("model_deg", phases_of(data.model_response, channel));
  return table;
}

std::pair<double, double> range_of(const ElementTable& table) {
  Eigen::MatrixXd values(table.columns[0].second.size(),
                         static_cast<Eigen::Index>(table.columns.size()) - 1);
  for (Eigen::Index c = 0; c < values.cols(); ++c)
    values.col(c) = table.columns[static_cast<std::size_t>(c) + 1].second;
  return magnitude_range(values);
}

/// Positions of the panels of the matrix.
struct Grid {
  double left_in = 0.76, right_in = 0.08, bottom_in = 0.4, top_in = 0.42, gap_in = 0.05;
  double width_in = 0.0, height_in = 0.0;

  Grid(std::size_t rows, std::size_t columns, Picture& picture) {
    for (double* margin_in : {&left_in, &right_in, &bottom_in, &top_in})
      *margin_in *= picture.text_scale();
    const auto across = static_cast<double>(columns);
    const auto down = static_cast<double>(rows);
    const double page_in = picture.style.width_in > 0.0 ? picture.style.width_in : kPage_in;
    width_in = std::max(0.35, (page_in - left_in - right_in - gap_in * (across - 1.0)) / across);
    height_in = std::clamp(0.65 * width_in, 0.9, 1.7);
    if (picture.style.height_in > 0.0)
      height_in = std::max(
          0.35, (picture.style.height_in - bottom_in - top_in - gap_in * (down - 1.0)) / down);
    picture.width_in = left_in + right_in + across * width_in + gap_in * (across - 1.0);
    picture.height_in = bottom_in + top_in + down * (height_in + gap_in) - gap_in;
  }
  double x_in(std::size_t column) const {
    return left_in + static_cast<double>(column) * (width_in + gap_in);
  }
  /// Lower edge; rows are counted from the top.
  double y_in(std::size_t row, const Picture& picture) const {
    return picture.height_in - top_in - static_cast<double>(row + 1) * height_in -
           static_cast<double>(row) * gap_in;
  }
};

/// Names over the columns and beside the rows, one axis title for all, the legend at the top.
std::string around_the_panels(const FrfEstimate& frf, const Grid& grid, const Picture& picture,
                              const std::vector<Eigen::Index>& outputs,
                              const std::vector<Eigen::Index>& inputs) {
  std::string script;
  const auto label = [&](const std::string& text, double x_in, double y_in,
                         const std::string& how) {
    script += fmt::format("set label {} at screen {},{} center noenhanced {}\n", text,
                          x_in / picture.width_in, y_in / picture.height_in, how);
  };
  const double middle_x_in = 0.5 * (grid.left_in + picture.width_in - grid.right_in);
  const double middle_y_in = 0.5 * (grid.bottom_in + picture.height_in - grid.top_in);
  const std::string unit = common_unit(frf, outputs, inputs);
  const double scale = picture.text_scale();
  for (std::size_t j = 0; j < inputs.size(); ++j)
    label(quoted(frf.inputs.name(inputs[j])), grid.x_in(j) + 0.5 * grid.width_in,
          picture.height_in - grid.top_in + 0.09 * scale, picture.font(7.0 / 8.0));
  for (std::size_t i = 0; i < outputs.size(); ++i)
    label(quoted(frf.outputs.name(outputs[i])), 0.3 * scale,
          grid.y_in(i, picture) + 0.5 * grid.height_in, "rotate by 90 " + picture.font(7.0 / 8.0));
  label("'Frequency [Hz]'", middle_x_in, 0.1 * scale, "");
  label(quoted(unit.empty() ? "Magnitude" : "Magnitude [" + unit + "]"), 0.1 * scale, middle_y_in,
        "rotate by 90");
  return script;
}

/// Only the panels on the left and lower edges of the matrix have labels.
std::string bode_panel(const Picture& picture, const Grid& grid, std::size_t row,
                       std::size_t column, bool lowest, const FrfEstimate& frf,
                       std::pair<double, double> magnitudes) {
  const double x_in = grid.x_in(column);
  const double y_in = grid.y_in(row, picture);
  return panel_edges(picture, x_in, x_in + grid.width_in, y_in, y_in + grid.height_in) +
         frequency_axis(frf.frequency_hz[0], frf.frequency_hz[frf.lines() - 1],
                        grid.width_in / picture.text_scale(), lowest) +
         magnitude_axis(magnitudes.first, magnitudes.second, grid.height_in / picture.text_scale(),
                        column == 0);
}

void check_count(std::size_t count, const char* kind, const char* flag) {
  if (count == 0 || count > static_cast<std::size_t>(kMostRowsOrColumns))
    fail_request("bode: {} {} do not fit in one figure; choose 1 to {} with {}", count, kind,
                 kMostRowsOrColumns, flag);
}

/// Curves of a table with their legends; the model is drawn above the measurement, both above their errors.
struct Curves {
  std::string drawn;
  std::vector<LegendEntry> legend;         ///< of the responses
  std::vector<LegendEntry> errors_legend;  ///< of residual and deviation
};

/// @param line_width_pt of the model; the measurement is a wider line below it
Curves curves_of(const ElementTable& table, const std::string& file, const char* kind,
                 double line_width_pt) {
  Curves curves;
  const auto add = [&](int column, const std::string& how) {
    curves.drawn += fmt::format("{}'{}' using 1:{} with {}",
                                curves.drawn.empty() ? "plot " : ", \\\n     ", file, column, how);
  };
  if (table.residual > 0) {
    add(table.residual, fmt::format("points {} ps 0.07 * point", kResidualColour));
    curves.errors_legend.push_back(
        {fmt::format("points {} ps 0.2 * point", kResidualColour), "residual", 8});
  }
  if (table.deviation > 0) {
    add(table.deviation, kDeviationLine);
    curves.errors_legend.push_back(
        {kDeviationLine, fmt::format("standard deviation ({})", kind), 26});
  }
  const std::string measured = fmt::format("lines {} lw {}", kMeasuredColour, 2.7 * line_width_pt);
  const std::string model = fmt::format("lines {} lw {}", kModelColour, line_width_pt);
  add(2, measured);
  curves.legend.push_back({measured, "measured", 8});
  if (table.model > 0) {
    add(table.model, model);
    curves.legend.push_back({model, "model", 5});
  }
  curves.drawn += "\n";
  return curves;
}

}  // namespace

Picture bode_picture(const ReportData& data, const std::vector<Eigen::Index>& outputs,
                     const std::vector<Eigen::Index>& inputs, const PictureStyle& style) {
  const FrfEstimate& frf = response_of(data, "bode");
  check_count(outputs.size(), "outputs", "--output-channel");
  check_count(inputs.size(), "inputs", "--input-channel");
  Picture picture;
  picture.style = style;
  const Grid grid(outputs.size(), inputs.size(), picture);
  std::vector<ElementTable> tables;
  std::pair<double, double> magnitudes = {INFINITY, 0.0};
  for (const Eigen::Index i : outputs)
    for (const Eigen::Index j : inputs) {
      tables.push_back(element_table(data, i + frf.n_outputs() * j, false));
      const auto [low, high] = range_of(tables.back());
      magnitudes = {std::min(magnitudes.first, low), std::max(magnitudes.second, high)};
    }
  picture.script = kFrame +
                   fmt::format("set xtics {0} offset 0,0.4\nset ytics {0} offset 0.4,0\n",
                               picture.font(6.0 / 8.0)) +
                   around_the_panels(frf, grid, picture, outputs, inputs);
  std::vector<LegendEntry> legend;
  for (std::size_t i = 0; i < outputs.size(); ++i)
    for (std::size_t j = 0; j < inputs.size(); ++j) {
      const ElementTable& table = tables[i * inputs.size() + j];
      const std::string file = fmt::format("{}_{}.txt", outputs[i], inputs[j]);
      picture.tables.push_back({file, table_text(table.columns)});
      const Curves curves = curves_of(table, file, "", 0.55);
      picture.script +=
          bode_panel(picture, grid, i, j, i + 1 == outputs.size(), frf, magnitudes) + curves.drawn;
      if (i + j == 0) picture.script += "unset label\n";  // drawn once for all panels
      legend = curves.legend;
    }
  picture.script += legend_row(picture, 0.12 * picture.text_scale(), legend) + "unset multiplot\n";
  return picture;
}

Picture entry_picture(const ReportData& data, Eigen::Index output, Eigen::Index input,
                      const PictureStyle& style) {
  const FrfEstimate& frf = response_of(data, "entry");
  const Eigen::Index channel = output + frf.n_outputs() * input;
  const ElementTable table = element_table(data, channel, true);
  const ElementTable phases = phase_table(data, channel);
  Picture picture = sized_picture(style, kColumn_in, 3.3);
  picture.tables = {{"entry.txt", table_text(table.columns)},
                    {"phase.txt", table_text(phases.columns)}};
  const Curves curves = curves_of(table, "entry.txt", report::uncertainty(frf).kind, 0.9);
  const std::string title =
      fmt::format("{} ← {}  [{}/{}]", frf.outputs.name(output), frf.inputs.name(input),
                  unit_of(frf.outputs, output), unit_of(frf.inputs, input));
  picture.script = panel_column(picture, frf.frequency_hz,
                                {range_of(table),
                                 title,
                                 curves.drawn,
                                 curves_of(phases, "phase.txt", "", 0.9).drawn,
                                 {curves.legend, curves.errors_legend}});
  return picture;
}

}  // namespace stageid
