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
class PlotCommand {
 public:
  PlotCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  Picture picture(const ReportData& data) const;
  Picture cmif(const ReportData& data) const;
  Picture entry(const ReportData& data) const;

  Console& console_;
  std::string figure_;
  std::vector<std::filesystem::path> inputs_;
  std::vector<std::string> output_channels_;
  std::vector<std::string> input_channels_;
  std::filesystem::path output_;
};

PlotCommand::PlotCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command =
      add_command(app, "plot", "Draw one figure of a response for print (needs gnuplot)");
  command
      ->add_option("figure", figure_,
                   "cmif: mode indicator function with the modes; bode: matrix of magnitudes; "
                   "entry: one element with residual and standard deviation")
      ->required();
  command
      ->add_option("inputs", inputs_,
                   "output directory of 'stageid identify', or files: FRF, model, modes "
                   "(candidates in cmif)")
      ->required();
  command
      ->add_option("--output-channel", output_channels_,
                   "entry: the output; bode: outputs A,B,... (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--input-channel", input_channels_,
                   "entry: the input; bode: inputs A,B,... (default: all)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("-o,--output", output_, "picture to write: .pdf, .svg or .png")->required();
  command->final_callback([this] { run(); });
}

Picture PlotCommand::cmif(const ReportData& data) const {
  if (!output_channels_.empty() || !input_channels_.empty())
    throw std::invalid_argument(
        "cmif: always uses all channels; --output-channel and --input-channel are for bode and "
        "entry");
  // Without modes.json and model, show the modes with which a fit would start.
  if (!data.chosen_modes.empty() || data.model) return cmif_picture(data);
  ReportData with_modes = data;
  with_modes.chosen_modes = pick_modes(*data.frf);
  return cmif_picture(with_modes);
}

Picture PlotCommand::entry(const ReportData& data) const {
  const Eigen::Index output = one_place("--output-channel", output_channels_, data.frf->outputs);
  return entry_picture(data, output,
                       one_place("--input-channel", input_channels_, data.frf->inputs));
}

Picture PlotCommand::picture(const ReportData& data) const {
  if (figure_ == "cmif") return cmif(data);
  if (figure_ == "entry") return entry(data);
  return bode_picture(data, places("--output-channel", output_channels_, data.frf->outputs),
                      places("--input-channel", input_channels_, data.frf->inputs));
}

void PlotCommand::run() const {
  if (std::ranges::find(kFigures, figure_) == kFigures.end())
    refuse_word("figure", figure_, kFigures);
  static_cast<void>(picture_format(output_));
  require_writable(output_, inputs_);
  const ReportInput input = report_input(inputs_);
  if (input.frf.empty())
    throw std::invalid_argument(fmt::format("{}: contains no frequency response; add an FRF file",
                                            inputs_.front().string()));
  draw(picture(read_response_data(input)), output_);
  console_.result(
      fmt::format("wrote {}, {} bytes", output_.string(), std::filesystem::file_size(output_)));
  console_.result({{"output", output_.string()},
                   {"figure", figure_},
                   {"bytes", std::filesystem::file_size(output_)}});
}

}  // namespace

std::shared_ptr<void> plot_command(CLI::App& app, Console& console) {
  return std::make_shared<PlotCommand>(app, console);
}

}  // namespace stageid
