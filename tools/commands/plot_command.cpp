#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

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
    throw std::invalid_argument(
        fmt::format("{}: the figure 'entry' needs exactly one channel; choose from {}", flag,
                    fmt::join(channels.names, ", ")));
  return all[0];
}

/// stageid plot {cmif|bode|entry} FRF [MODEL] -o FILE.{pdf,svg,png}
struct PlotFlags {
  std::string figure;
  std::vector<std::filesystem::path> inputs;
  std::vector<std::string> output_channels;
  std::vector<std::string> input_channels;
  std::filesystem::path output;
};

Picture cmif_of(const PlotFlags& flags, const ReportData& data) {
  if (!flags.output_channels.empty() || !flags.input_channels.empty())
    throw std::invalid_argument(
        "cmif: always uses all channels; --output-channel and --input-channel are for bode and "
        "entry");
  // Without modes.json and model, show the modes with which a fit would start.
  if (!data.chosen_modes.empty() || data.model) return cmif_picture(data);
  ReportData with_modes = data;
  with_modes.chosen_modes = pick_modes(*data.frf);
  return cmif_picture(with_modes);
}

Picture entry_of(const PlotFlags& flags, const ReportData& data) {
  const Eigen::Index output =
      one_place("--output-channel", flags.output_channels, data.frf->outputs);
  return entry_picture(data, output,
                       one_place("--input-channel", flags.input_channels, data.frf->inputs));
}

Picture requested_picture(const PlotFlags& flags, const ReportData& data) {
  if (flags.figure == "cmif") return cmif_of(flags, data);
  if (flags.figure == "entry") return entry_of(flags, data);
  return bode_picture(data, places("--output-channel", flags.output_channels, data.frf->outputs),
                      places("--input-channel", flags.input_channels, data.frf->inputs));
}

void plot(const PlotFlags& flags, Console& console) {
  if (std::ranges::find(kFigures, flags.figure) == kFigures.end())
    refuse_word("figure", flags.figure, kFigures);
  static_cast<void>(picture_format(flags.output));
  require_writable(flags.output, flags.inputs);
  const ReportInput input = report_input(flags.inputs);
  if (input.frf.empty())
    throw std::invalid_argument(fmt::format("{}: contains no frequency response; add an FRF file",
                                            flags.inputs.front().string()));
  draw(requested_picture(flags, read_response_data(input)), flags.output);
  console.result(fmt::format("wrote {}, {} bytes", flags.output.string(),
                             std::filesystem::file_size(flags.output)));
  console.result({{"output", flags.output.string()},
                  {"figure", flags.figure},
                  {"bytes", std::filesystem::file_size(flags.output)}});
}

}  // namespace

void plot_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(
      app, console, "plot", "Draw one figure of a response for print (needs gnuplot)", plot);
  command
      .add_option("figure", flags.figure,
                  "cmif: mode indicator function with the modes; bode: matrix of magnitudes; "
                  "entry: one element with residual and standard deviation")
      ->required();
  command
      .add_option("inputs", flags.inputs,
                  "output directory of 'stageid identify', or files: FRF, model, modes "
                  "(the candidates shown in cmif)")
      ->required();
  command
      .add_option("--output-channel", flags.output_channels,
                  "entry: the output; bode: outputs A,B,... (default: all)")
      ->type_name("CHANNEL")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      .add_option("--input-channel", flags.input_channels,
                  "entry: the input; bode: inputs A,B,... (default: all)")
      ->type_name("CHANNEL")
      ->delimiter(',')
      ->allow_extra_args(false);
  command.add_option("-o,--output", flags.output, "picture to write: .pdf, .svg or .png")
      ->required();
}

}  // namespace stageid
