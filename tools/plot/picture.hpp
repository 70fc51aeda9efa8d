#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

namespace stageid {

/// What a user chooses of a figure; sizes 0: those of the figure.
struct PictureStyle {
  double width_in = 0.0;
  double height_in = 0.0;
  std::string font = "Helvetica";
  double font_pt = 8.0;
  bool grey = false;  ///< colours become grey of the same brightness
};

/// A static figure for gnuplot: commands and tables, independent of the file format.
struct Picture {
  /// Rows of numbers, separated by blanks; the numbers read back exactly.
  struct Table {
    std::string name;  ///< of the file read by the script
    std::string text;
  };
  double width_in = 0.0;
  double height_in = 0.0;
  std::string script;
  std::vector<Table> tables;
  PictureStyle style = {};

  /// Space for texts, relative to that of the default font.
  double text_scale() const noexcept { return style.font_pt / PictureStyle{}.font_pt; }
  /// "font ',SIZE'": a part of the size of the figure's font.
  std::string font(double part) const;
};

/// An empty picture of the size of the style, else of the given one; a wider one is higher too, up to 1.6 times.
Picture sized_picture(const PictureStyle& style, double width_in, double height_in);

/// Columns of equal length, below a comment with their names.
/// @throws std::invalid_argument if lengths differ.
std::string table_text(const std::vector<std::pair<std::string, Eigen::VectorXd>>& columns);

/// An external text as a safe string of gnuplot: in single quotes, without control characters, well-formed UTF-8. Use
/// it with `noenhanced`, which keeps _ and ^ unchanged.
std::string quoted(const std::string& text);

/// "set xrange ...", "set xtics ..." of a logarithmic frequency axis `width_in` wide, with as many plain numbers as
/// are legible, and small ticks between them. No labels unless `labelled`.
std::string frequency_axis(double low_hz, double high_hz, double width_in, bool labelled = true);

/// The same for logarithmic magnitudes, powers of ten, over whole decades that contain low to high.
std::string magnitude_axis(double low, double high, double height_in, bool labelled = true);

/// Smallest and largest value for a logarithmic axis; {1, 10} if there is none. The lowest 1 in 500 points are
/// ignored: there, noise happened to cancel the response.
std::pair<double, double> magnitude_range(const Eigen::Ref<const Eigen::MatrixXd>& magnitudes);

/// The edges of a panel, in inches from the lower left corner of the picture.
std::string panel_edges(const Picture& picture, double left_in, double right_in, double bottom_in,
                        double top_in);

/// The beginning of a script: a thin border, outward ticks and a faint grid in every panel.
inline constexpr const char* kFrame =
    "set multiplot\nunset key\n"
    "set border 15 lw 0.5 lc rgb '#404040'\nset tics nomirror scale 0.5,0.25\n"
    "set grid xtics ytics lt 1 lw 0.4 dt 1 lc rgb '#dcdcdc'\n";

/// The legend entry of a curve.
struct LegendEntry {
  std::string style;   ///< text after "with" in gnuplot's plot command
  std::string title;   ///< our own text: _ and ^ make indices
  int characters = 0;  ///< visible characters of the title
};

/// A centred row of the legend, `y_in` inches below the upper edge of the picture. Each entry is placed individually
/// in a panel as large as the picture, because gnuplot stacks entries of one legend if it considers them too wide.
/// Must be the last part that is drawn.
std::string legend_row(const Picture& picture, double y_in,
                       const std::vector<LegendEntry>& entries);

/// What a picture with one column of panels shows over frequency.
struct PanelContent {
  std::pair<double, double> magnitudes;
  std::string title;  ///< of the vertical axis, external text
  std::string drawn;  ///< commands from the first one for this panel to "plot ..." and its line end
  std::string phase = {};  ///< the same for a panel of phases below; empty: none
  std::vector<std::vector<LegendEntry>> legends = {};  ///< rows; empty ones are left out
};

/// Magnitudes over frequency, and phases from -180 to 180 degrees below.
std::string panel_column(const Picture& picture, const Eigen::VectorXd& frequency_hz,
                         const PanelContent& content);

}  // namespace stageid
