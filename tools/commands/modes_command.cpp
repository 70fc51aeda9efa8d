#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "estimation/model/cmif.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/dc_line.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// stageid modes FRF [-o modes.json]
struct ModesFlags {
  std::filesystem::path frf;
  std::filesystem::path output;
  std::vector<double> band_hz;
  CmifKind kind = CmifKind::accelerance;
  double prominence_db = 3.0;
};

void find_modes(const ModesFlags& flags, Console& console) {
  if (!flags.output.empty()) {
    require_writable(flags.output, {flags.frf});
    require_ending(flags.output, "a list of modes", {".json"});
  }
  FrfEstimate frf = read_frf(flags.frf);
  if (!flags.band_hz.empty()) frf = select_band(std::move(frf), flags.band_hz[0], flags.band_hz[1]);
  if (has_dc_line(frf)) {
    console.warning("{}: {}", flags.frf.string(), kDcLineLeftOut);
    frf = without_dc_line(std::move(frf));
  }
  PeakOptions options;
  options.kind = flags.kind;
  options.minimum_prominence_db = flags.prominence_db;
  const std::vector<ModeCandidate> modes = pick_modes(frf, options);
  if (!flags.output.empty() && console.team->rank() == 0) write_modes(flags.output, modes);

  std::vector<std::vector<std::string>> rows = {{"mode", "frequency/Hz", "damping", "curve"}};
  Json list = Json::array();
  for (const ModeCandidate& mode : modes) {
    rows.push_back({fmt::format("{}", rows.size()), fmt::format("{:.4f}", mode.frequency_hz),
                    fmt::format("{:.5f}", mode.damping_ratio), fmt::format("{}", mode.cmif_curve)});
    list.push_back({{"frequency_hz", mode.frequency_hz},
                    {"damping_ratio", mode.damping_ratio},
                    {"cmif_curve", mode.cmif_curve}});
  }
  for (const std::string& line : table_lines(rows)) console.result(line);
  if (!flags.output.empty()) console.result("wrote {}", flags.output.string());
  console.result({{"modes", list}, {"output", flags.output.string()}});
}

}  // namespace

void modes_command(CLI::App& app, Console& console) {
  auto [command, flags] =
      add_command(app, console, "modes",
                  "Find candidate modes of an FRF with a mode indicator function", find_modes);
  add_required(command, "frf", flags.frf, "frf.h5");
  command.add_option("-o,--output", flags.output, "modes.json to write");
  add_band(command, flags.band_hz, "all lines");
  add_choice(
      command, "--kind", flags.kind,
      "matrix to analyse: response: the FRF G | accelerance: omega^2 G | whitened: G divided by "
      "its standard deviations");
  add_setting(command, "--prominence", flags.prominence_db, "DB",
              "minimum prominence of a peak, dB", kNotNegative);
}

}  // namespace stageid
