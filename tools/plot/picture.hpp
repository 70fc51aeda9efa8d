#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

namespace stageid {

/// A static figure as gnuplot takes it: commands, and tables beside them. It says nothing of the file's format.
struct Picture {
  /// Rows of numbers, separated by blanks, each number such that reading gives it back exactly.
  struct Table {
    std::string name;  ///< of the file that the script reads
    std::string text;
  };
  double width_in = 0.0;
  double height_in = 0.0;
  std::string script;
  std::vector<Table> tables;
};

/// Columns of equal length side by side, under a comment with their names.
/// @throws std::invalid_argument if lengths differ.
std::string table_text(const std::vector<std::pair<std::string, Eigen::VectorXd>>& columns);

/// A text from outside as a string of gnuplot, such that nothing in it is a command: in single quotes, without
/// control characters, well-formed UTF-8. Where it is used, `noenhanced` keeps its _ and ^ as they are.
std::string quoted(const std::string& text);

/// "set xrange ...", "set xtics ..." of a logarithmic frequency axis `width_in` wide: plain numbers, as many as
/// can be read. Without labels where `labelled` is false.
std::string frequency_axis(double low_hz, double high_hz, double width_in, bool labelled = true);

/// The same for logarithmic magnitudes, powers of ten, over whole decades that hold low to high.
std::string magnitude_axis(double low, double high, double height_in, bool labelled = true);

/// Smallest and largest of what can stand on a logarithmic axis; {1, 10} if nothing can. The deepest of
/// thousands of points, where noise happened to cancel the response, do not count: 1 in 500.
std::pair<double, double> magnitude_range(const Eigen::Ref<const Eigen::MatrixXd>& magnitudes);

/// A panel's edges, in inches from the picture's lower left corner.
std::string panel_edges(const Picture& picture, double left_in, double right_in, double bottom_in,
                        double top_in);

/// What every panel has: a thin border, ticks outwards from it, a faint grid.
inline constexpr const char* kFrame =
    "set border 15 lw 0.5 lc rgb '#404040'\nset tics nomirror scale 0.5,0.25\n"
    "set grid xtics ytics lt 1 lw 0.4 dt 1 lc rgb '#dcdcdc'\n";

/// What the legend says of a curve.
struct LegendEntry {
  std::string style;   ///< as gnuplot's plot command takes it behind "with"
  std::string title;   ///< ours, nothing from outside: _ and ^ make indices
  int characters = 0;  ///< of the title as it is seen
};

/// A row of the legend in the middle of the picture, `y_in` inches below its upper edge. Each entry is placed by itself in
/// a panel as large as the picture: gnuplot sets those of one legend below each other where it thinks that they are
/// too wide. Ends what is drawn: the panels come before.
std::string legend_row(const Picture& picture, double y_in,
                       const std::vector<LegendEntry>& entries);

}  // namespace stageid
