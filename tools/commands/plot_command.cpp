#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <numeric>
#include <string>
#include <tuple>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "estimation/model/cmif.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/plot/gnuplot.hpp"
#include "tools/plot/picture.hpp"
#include "tools/plot/response_pictures.hpp"
#include "tools/report/report_input.hpp"
#include "tools/report/report_page.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

const std::vector<std::string> kFigures = {"cmif", "bode", "entry"};

/// The width of a figure: its own, or that of one or two columns of a journal.
enum class PlotPreset : std::uint8_t { figure, single, both };
enum class PlotTheme : std::uint8_t { colour, grey };

}  // namespace

template <>
inline constexpr std::array kWords<PlotPreset> = {"figure", "single", "double"};
template <>
inline constexpr std::array kWords<PlotTheme> = {"colour", "grey"};

namespace {

/// Indices of the named channels, in the given order; of all channels if none is named.
std::vector<Eigen::Index> places(const char* flag, const std::vector<std::string>& names,
                                 const ChannelList& channels) {
  std::vector<Eigen::Index> out(names.empty() ? channels.size() : names.size());
  if (names.empty()) std::iota(out.begin(), out.end(), 0);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto found = std::ranges::find(channels.names, names[i]);
    if (found == channels.names.end()) refuse_word(flag, names[i], channels.names);
    out[i] = found - channels.names.begin();
  }
  return out;
}

/// The only requested channel, or the only one.
Eigen::Index one_place(const char* flag, const std::vector<std::string>& names,
                       const ChannelList& channels) {
  const std::vector<Eigen::Index> all = places(flag, names, channels);
  if (all.size() != 1)
    fail_request("{}: the figure 'entry' needs exactly one channel; choose from {}", flag,
                 fmt::join(channels.names, ", "));
  return all[0];
}

/// stageid plot {cmif|bode|entry} FRF [MODEL] -o FILE.{pdf,svg,png}
struct PlotFlags {
  std::string figure;
  std::vector<std::filesystem::path> inputs;
  std::vector<std::string> output_channels;
  std::vector<std::string> input_channels;
  std::filesystem::path output;
  PlotPreset preset = PlotPreset::figure;
  double width_mm = 0.0;
  double height_mm = 0.0;
  PlotTheme theme = PlotTheme::colour;
  PictureStyle style;
  std::vector<double> band_hz;
};

PictureStyle style_of(const PlotFlags& flags) {
  constexpr double kInch_mm = 25.4, kLeast_mm = 30.0, kMost_mm = 1000.0;
  PictureStyle style = flags.style;
  style.grey = flags.theme == PlotTheme::grey;
  if (flags.preset != PlotPreset::figure)
    style.width_in = flags.preset == PlotPreset::single ? kColumn_in : kPage_in;
  for (const auto& [flag, size_mm, size_in] :
       {std::tuple("--width", flags.width_mm, &style.width_in),
        std::tuple("--height", flags.height_mm, &style.height_in)}) {
    if (size_mm == 0.0) continue;
    if (!(size_mm >= kLeast_mm && size_mm <= kMost_mm))
      fail_request("{}: got {} mm; expected {} to {}", flag, size_mm, kLeast_mm, kMost_mm);
    *size_in = size_mm / kInch_mm;
  }
  if (!(style.font_pt >= 4.0 && style.font_pt <= 40.0))
    fail_request("--font-size: got {} pt; expected 4 to 40", style.font_pt);
  const auto of_names = [](unsigned char c) {
    return std::isalnum(c) != 0 || c == ' ' || c == '-';
  };
  if (style.font.empty() || !std::ranges::all_of(style.font, of_names))
    fail_request("--font: got '{}'; expected the name of a font, such as Times", style.font);
  return style;
}

/// Keeps the lines within the requested band.
void keep_band(const std::vector<double>& band_hz, ReportData& data) {
  if (band_hz.empty()) return;
  const Eigen::VectorXd all_hz = data.frf->frequency_hz;
  data.frf = select_band(std::move(*data.frf), band_hz[0], band_hz[1]);
  const auto first = std::ranges::find(all_hz, data.frf->frequency_hz[0]) - all_hz.begin();
  if (data.model_response.size() > 0)
    data.model_response = data.model_response.middleCols(first, data.frf->lines()).eval();
  if (data.cmif_curves.size() > 0)
    data.cmif_curves = data.cmif_curves.middleCols(first, data.frf->lines()).eval();
}

Picture cmif_of(const PlotFlags& flags, const ReportData& data) {
  if (!flags.output_channels.empty() || !flags.input_channels.empty())
    fail_request(
        "cmif: always uses all channels; --output-channel and --input-channel are for bode and "
        "entry");
  // Without modes.json and model, show the modes with which a fit would start.
  if (!data.chosen_modes.empty() || data.model) return cmif_picture(data, style_of(flags));
  ReportData with_modes = data;
  with_modes.chosen_modes = pick_modes(*data.frf);
  return cmif_picture(with_modes, style_of(flags));
}

Picture entry_of(const PlotFlags& flags, const ReportData& data) {
  const Eigen::Index output =
      one_place("--output-channel", flags.output_channels, data.frf->outputs);
  return entry_picture(data, output,
                       one_place("--input-channel", flags.input_channels, data.frf->inputs),
                       style_of(flags));
}

Picture requested_picture(const PlotFlags& flags, const ReportData& data) {
  if (flags.figure == "cmif") return cmif_of(flags, data);
  if (flags.figure == "entry") return entry_of(flags, data);
  return bode_picture(data, places("--output-channel", flags.output_channels, data.frf->outputs),
                      places("--input-channel", flags.input_channels, data.frf->inputs),
                      style_of(flags));
}

void plot(const PlotFlags& flags, Console& console) {
  if (std::ranges::find(kFigures, flags.figure) == kFigures.end())
    refuse_word("figure", flags.figure, kFigures);
  static_cast<void>(picture_format(flags.output));
  require_writable(flags.output, flags.inputs);
  const ReportInput input = report_input(flags.inputs);
  if (input.frf.empty())
    fail_request("{}: contains no frequency response; add an FRF file",
                 flags.inputs.front().string());
  ReportData data = read_response_data(input);
  keep_band(flags.band_hz, data);
  draw(requested_picture(flags, data), flags.output);
  console.result("wrote {}, {} bytes", flags.output.string(),
                 std::filesystem::file_size(flags.output));
  console.result({{"output", flags.output.string()},
                  {"figure", flags.figure},
                  {"bytes", std::filesystem::file_size(flags.output)}});
}

}  // namespace

void plot_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(
      app, console, "plot", "Draw one figure of a response for print (needs gnuplot)", plot);
  add_required(command, "figure", flags.figure,
               "cmif: mode indicator function with the modes; bode: matrix of magnitudes; "
               "entry: one element with residual and standard deviation");
  add_required(command, "inputs", flags.inputs,
               "output directory of 'stageid identify', or files: FRF, model, modes "
               "(the candidates shown in cmif)");
  add_value(command, "--output-channel", flags.output_channels, "CHANNEL",
            "entry: the output; bode: outputs A,B,... (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  add_value(command, "--input-channel", flags.input_channels, "CHANNEL",
            "entry: the input; bode: inputs A,B,... (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  add_required(command, "-o,--output", flags.output, "picture to write: .pdf, .svg or .png");
  add_band(command, flags.band_hz, "all lines, or the band of the model");
  add_choice(
      command, "--preset", flags.preset,
      "width: of the figure | single: a column of a journal, 88.9 mm | double: both, 181.9 mm");
  add_value(command, "--width", flags.width_mm, "MM", "width of the picture, mm");
  add_value(command, "--height", flags.height_mm, "MM", "height of the picture, mm");
  add_setting(command, "--font", flags.style.font, "NAME", "font, as of fontconfig");
  add_setting(command, "--font-size", flags.style.font_pt, "PT", "size of the font, pt");
  add_choice(command, "--theme", flags.theme, "colour, which also differs in brightness | grey");
}

}  // namespace stageid
