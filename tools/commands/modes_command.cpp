#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "estimation/model/cmif.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/dc_line.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// stageid modes FRF [-o modes.json]
class ModesCommand {
 public:
  ModesCommand(CLI::App& app, Console& console);

 private:
  void run() const;

  Console& console_;
  std::filesystem::path frf_;
  std::filesystem::path output_;
  std::vector<double> band_hz_;
  CmifKind kind_ = CmifKind::accelerance;
  double prominence_db_ = 3.0;
};

ModesCommand::ModesCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command =
      add_command(app, "modes", "Find candidate modes of an FRF with a mode indicator function");
  command->add_option("frf", frf_, "frf.h5")->required();
  command->add_option("-o,--output", output_, "modes.json to write");
  command->add_option("--band", band_hz_, "LOW HIGH, Hz")->expected(2);
  add_choice(*command, "--kind", kind_,
             "response: G | accelerance: omega^2 G | whitened: G over its standard deviations");
  command->add_option("--prominence", prominence_db_, "minimum prominence of a peak, dB")
      ->check(kNotNegative)
      ->capture_default_str();
  command->final_callback([this] { run(); });
}

void ModesCommand::run() const {
  if (!output_.empty()) {
    require_writable(output_, {frf_});
    require_ending(output_, "a list of modes", {".json"});
  }
  FrfEstimate frf = read_frf(frf_);
  if (!band_hz_.empty()) frf = select_band(std::move(frf), band_hz_[0], band_hz_[1]);
  if (has_dc_line(frf)) {
    console_.warning(fmt::format("{}: {}", frf_.string(), kDcLineLeftOut));
    frf = without_dc_line(std::move(frf));
  }
  PeakOptions options;
  options.kind = kind_;
  options.minimum_prominence_db = prominence_db_;
  const std::vector<ModeCandidate> modes = pick_modes(frf, options);
  if (!output_.empty()) write_modes(output_, modes);

  std::vector<std::vector<std::string>> rows = {{"mode", "frequency/Hz", "damping", "curve"}};
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const ModeCandidate& mode : modes) {
    rows.push_back({fmt::format("{}", rows.size()), fmt::format("{:.4f}", mode.frequency_hz),
                    fmt::format("{:.5f}", mode.damping_ratio), fmt::format("{}", mode.cmif_curve)});
    list.push_back({{"frequency_hz", mode.frequency_hz},
                    {"damping_ratio", mode.damping_ratio},
                    {"cmif_curve", mode.cmif_curve}});
  }
  for (const std::string& line : table_lines(rows)) console_.result(line);
  if (!output_.empty()) console_.result(fmt::format("wrote {}", output_.string()));
  console_.result({{"modes", list}, {"output", output_.string()}});
}

}  // namespace

std::shared_ptr<void> modes_command(CLI::App& app, Console& console) {
  return std::make_shared<ModesCommand>(app, console);
}

}  // namespace stageid
