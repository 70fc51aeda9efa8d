#include "tools/plot/picture.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "acquisition/files/fail.hpp"
#include "frf/statistics/order_statistic.hpp"
#include "tools/terminal/unicode.hpp"

namespace stageid {
namespace {

/// Smallest distance of labels of frequencies, and of powers of ten.
constexpr double kLabelWidth_in = 0.3;
constexpr double kLabelHeight_in = 0.22;
/// A shorter decade has no ticks within it.
constexpr double kMinorDecade_in = 0.3;

/// Width of a character of the legend, and of the sample beside a title plus the space to the next entry.
constexpr double kCharacter_in = 0.06;
constexpr double kSample_in = 0.5;

/// Candidates for the labels of each decade, the densest first; then every second decade, every third.
std::vector<double> frequencies_to_label(double low_hz, double high_hz, double width_in) {
  const std::vector<std::vector<double>> digits = {{1, 2, 5}, {1, 3}, {1}};
  const int first = static_cast<int>(std::floor(std::log10(low_hz)));
  const int last = static_cast<int>(std::ceil(std::log10(high_hz)));
  std::vector<double> found;
  for (int sparse = 0; sparse < 8; ++sparse) {
    const auto& of_decade = digits[std::min(sparse, 2)];
    const int step = std::max(1, sparse - 1);
    found.clear();
    for (int decade = first; decade <= last; ++decade)
      for (const double digit : of_decade) {
        const double hz = digit * std::pow(10.0, decade);
        if (decade % step == 0 && hz >= low_hz && hz <= high_hz) found.push_back(hz);
      }
    const auto crowded = [&](double a, double b) {
      return std::log10(b / a) / std::log10(high_hz / low_hz) * width_in < kLabelWidth_in;
    };
    if (std::ranges::adjacent_find(found, crowded) == found.end()) break;
  }
  return found;
}

}  // namespace

std::string table_text(const std::vector<std::pair<std::string, Eigen::VectorXd>>& columns) {
  std::string text = "#";
  for (const auto& [name, values] : columns) {
    text += " " + name;
    if (values.size() != columns[0].second.size())
      fail_request("table: column '{}' has {} rows; expected {}", name, values.size(),
                   columns[0].second.size());
  }
  text += "\n";
  for (Eigen::Index k = 0; !columns.empty() && k < columns[0].second.size(); ++k)
    for (std::size_t c = 0; c < columns.size(); ++c)
      text += fmt::format("{}{}", columns[c].second[k], c + 1 < columns.size() ? " " : "\n");
  return text;
}

std::string quoted(const std::string& text) {
  std::u32string points;
  for (const char32_t point : code_points_of(text)) {
    const bool control = point < 0x20 || (point >= 0x7f && point < 0xa0);
    points += control ? U' ' : point;
    if (point == U'\'') points += point;  // an escaped quote
  }
  return fmt::format("'{}'", utf8_of(points));
}

std::string Picture::font(double part) const {
  return fmt::format("font ',{:.4g}'", part * style.font_pt);
}

Picture sized_picture(const PictureStyle& style, double width_in, double height_in) {
  constexpr double kMostHigher = 1.6;
  Picture picture;
  picture.style = style;
  picture.width_in = style.width_in > 0.0 ? style.width_in : width_in;
  picture.height_in = style.height_in > 0.0
                          ? style.height_in
                          : height_in * std::min(kMostHigher, picture.width_in / width_in);
  return picture;
}

std::string frequency_axis(double low_hz, double high_hz, double width_in, bool labelled) {
  if (!(low_hz > 0.0)) low_hz = std::min(1.0, 0.1 * high_hz);
  if (!(high_hz > low_hz)) high_hz = 10.0 * low_hz;
  std::vector<std::string> labels;
  for (const double hz : frequencies_to_label(low_hz, high_hz, width_in))
    labels.push_back(fmt::format("'{}' {}", labelled ? fmt::format("{:g}", hz) : "", hz));
  const int most = width_in / std::log10(high_hz / low_hz) > kMinorDecade_in ? 9 : 1;
  for (double hz = std::pow(10.0, std::floor(std::log10(low_hz))); hz <= high_hz; hz *= 10.0)
    for (int digit = 1; digit <= most; ++digit)
      if (digit * hz >= low_hz && digit * hz <= high_hz)
        labels.push_back(fmt::format("'' {} 1", digit * hz));
  return fmt::format("set logscale x 10\nset xrange [{}:{}]\nset xtics ({})\n", low_hz, high_hz,
                     fmt::join(labels, ", "));
}

std::string magnitude_axis(double low, double high, double height_in, bool labelled) {
  const int first = static_cast<int>(std::floor(std::log10(low)));
  const int last = std::max(first + 1, static_cast<int>(std::ceil(std::log10(high))));
  const int most = std::max(2, static_cast<int>(height_in / kLabelHeight_in));
  int step = 1;
  while ((last - first) / step + 1 > most) ++step;
  std::vector<std::string> labels;
  for (int decade = last - (last - first) / step * step; decade <= last; decade += step)
    labels.push_back(fmt::format(
        "'{}' 1e{}",
        labelled ? fmt::format("10^{{{}{}}}", decade < 0 ? "−" : "", std::abs(decade)) : "",
        decade));
  const int digits = height_in / (last - first) > kMinorDecade_in ? 9 : 1;
  for (int decade = first; decade < last; ++decade)
    for (int digit = 1; digit <= digits; ++digit)
      labels.push_back(fmt::format("'' {}e{} 1", digit, decade));
  return fmt::format("set logscale y 10\nset yrange [1e{}:1e{}]\nset ytics ({})\n", first, last,
                     fmt::join(labels, ", "));
}

std::pair<double, double> magnitude_range(const Eigen::Ref<const Eigen::MatrixXd>& magnitudes) {
  std::vector<double> positive;
  for (const double value : magnitudes.reshaped())
    if (value > 0.0 && std::isfinite(value)) positive.push_back(value);
  if (positive.empty()) return {1.0, 10.0};
  const double high = *std::ranges::max_element(positive);
  return {order_statistic(positive, 0.002), high};
}

std::string panel_edges(const Picture& picture, double left_in, double right_in, double bottom_in,
                        double top_in) {
  return fmt::format(
      "set lmargin at screen {}\nset rmargin at screen {}\nset bmargin at screen {}\n"
      "set tmargin at screen {}\n",
      left_in / picture.width_in, right_in / picture.width_in, bottom_in / picture.height_in,
      top_in / picture.height_in);
}

std::string legend_row(const Picture& picture, double y_in,
                       const std::vector<LegendEntry>& entries) {
  std::string script =
      "set lmargin at screen 0\nset rmargin at screen 1\nset bmargin at screen 0\n"
      "set tmargin at screen 1\nunset border\nunset tics\nunset grid\nunset label\nunset arrow\n"
      "unset xlabel\nunset ylabel\nunset logscale\nset xrange [0:1]\nset yrange [0:1]\n";
  const auto width_in = [&](const LegendEntry& entry) {
    return picture.text_scale() * (kSample_in + kCharacter_in * entry.characters);
  };
  double x_in = 0.5 * picture.width_in;
  for (const LegendEntry& entry : entries) x_in -= 0.5 * width_in(entry);
  for (const LegendEntry& entry : entries) {
    script += fmt::format(
        "set key at screen {},{} center center samplen 1.8 {}\nplot NaN with {} title '{}'\n",
        (x_in + 0.5 * width_in(entry)) / picture.width_in, 1.0 - y_in / picture.height_in,
        picture.font(7.0 / 8.0), entry.style, entry.title);
    x_in += width_in(entry);
  }
  return script;
}

std::string panel_column(const Picture& picture, const Eigen::VectorXd& frequency_hz,
                         const PanelContent& content) {
  const double text = picture.text_scale();
  const double left_in = 0.62 * text, right_in = picture.width_in - 0.12 * text;
  const double bottom_in = 0.4 * text, top_in = picture.height_in - 0.4 * text;
  const double gap_in = 0.1 * text;
  const bool phase = !content.phase.empty();
  const double middle_in = phase ? bottom_in + 0.32 * (top_in - bottom_in) : bottom_in;
  const auto frequencies = [&](bool labelled) {
    return frequency_axis(frequency_hz[0], frequency_hz[frequency_hz.size() - 1],
                          (right_in - left_in) / text, labelled);
  };
  const std::string below = "set xlabel 'Frequency [Hz]' offset 0,0.4\n";
  std::string script =
      kFrame + panel_edges(picture, left_in, right_in, middle_in + (phase ? gap_in : 0.0), top_in) +
      frequencies(!phase) +
      magnitude_axis(content.magnitudes.first, content.magnitudes.second,
                     (top_in - middle_in) / text) +
      (phase ? "" : below) +
      fmt::format("set ylabel {} noenhanced offset 1,0\n", quoted(content.title)) + content.drawn;
  if (phase)
    script += panel_edges(picture, left_in, right_in, bottom_in, middle_in) + frequencies(true) +
              "unset logscale y\nset yrange [-180:180]\n"
              "set ytics ('−180' -180, '−90' -90, '0' 0, '90' 90, '180' 180)\n" +
              below + "set ylabel 'Phase [°]' offset 1,0\n" + content.phase;
  double y_in = 0.1 * text;
  for (const std::vector<LegendEntry>& legend : content.legends) {
    if (!legend.empty()) script += legend_row(picture, y_in, legend);
    y_in = 0.28 * text;
  }
  return script + "unset multiplot\n";
}

}  // namespace stageid
