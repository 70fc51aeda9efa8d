#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/version.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/arrays/frf_arrays.hpp"
#include "tools/exchange/import/array_formats.hpp"
#include "tools/exchange/import/frf_formats.hpp"
#include "tools/exchange/import/import_summary.hpp"
#include "tools/exchange/import/mapped_frf.hpp"
#include "tools/exchange/import/mapped_log.hpp"
#include "tools/exchange/import/si_unit.hpp"
#include "tools/exchange/model/mode_correlation.hpp"
#include "tools/exchange/uff/uff_frf.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

void require_frf_output(const std::filesystem::path& output) {
  if (output.extension() != ".h5" && output.extension() != ".hdf5")
    throw std::invalid_argument(
        fmt::format("{}: a frequency response is written as .h5; use a name with that ending",
                    output.string()));
}

/// Keeps the provenance of a stageid file; otherwise the foreign file is the provenance.
ImportSummary write_imported(const std::filesystem::path& output, FrfEstimate frf,
                             const std::filesystem::path& input, std::vector<std::string> notes) {
  try {
    take_si_units(frf, notes);
  } catch (const std::invalid_argument& error) {
    throw FormatError(input, "", error.what());
  }
  if (frf.provenance_json == "{}")
    frf.provenance_json = nlohmann::ordered_json{
        {"imported", input.filename().string()},
        {"fingerprint", fingerprint_of_file(input)},
        {"version",
         version()}}.dump();
  write_frf(output, frf);
  return summary_of(frf, notes);
}

/// stageid import FILE.{unv,uff,mat,csv,h5,npz,sNp} -o frf.h5|run.slog [--map MAP.yaml]; without -o it lists the
/// content of the file.
class ImportCommand {
 public:
  ImportCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  void list() const;
  void require_input() const;
  ImportSummary import_with_map() const;

  Console& console_;
  std::filesystem::path input_;
  std::filesystem::path output_;
  std::filesystem::path map_;
};

ImportCommand::ImportCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command =
      add_command(app, "import", "Import a frequency response or a log written by another program");
  command->add_option("file", input_,
                      "foreign file: .unv, .uff, .mat, .csv, .h5, .npz, .sNp (Touchstone); for a "
                      "log also a pattern such as 'run_{realization}_{experiment}.mat'");
  command->add_option(
      "-o,--output", output_,
      "file to write: frf.h5; run.slog or run.h5 for a log; modes.json for the mode shapes of a "
      "universal file. Default: list the arrays of the file, to help you write a map");
  command->add_option(
      "--map", map_,
      "YAML file with the meaning of the arrays; needed if the format does not define it");
  command->final_callback([this] { run(); });
}

void ImportCommand::list() const {
  if (!map_.empty()) throw std::invalid_argument("--map: needs an output file; add -o FILE");
  std::vector<std::vector<std::string>> rows = {{"array", "size", "holds"}};
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  const ArrayList arrays = read_foreign_arrays(input_);
  for (const NamedArray& array : arrays.arrays) {
    const char* holds = array.is_text() ? "text" : array.is_complex() ? "complex" : "real";
    rows.push_back({array.name, fmt::format("{}", fmt::join(array.shape, " x ")), holds});
    json.push_back({{"name", array.name}, {"size", array.shape}, {"holds", holds}});
  }
  for (const UnreadVariable& variable : arrays.unread) {
    rows.push_back({variable.name, "", variable.what});
    json.push_back({{"name", variable.name},
                    {"size", nlohmann::ordered_json::array()},
                    {"holds", variable.what},
                    {"remedy", variable.remedy}});
  }
  for (const std::string& line : table_lines(rows)) console_.result(line);
  for (const UnreadVariable& variable : arrays.unread)
    console_.result(
        fmt::format("{}: {} cannot be read. {}", variable.name, variable.what, variable.remedy));
  console_.result({{"arrays", json}});
}

ImportSummary ImportCommand::import_with_map() const {
  const ImportMap map = read_import_map(map_);
  if (map.kind == ImportMap::Kind::log) {
    const std::vector<ForeignFile> files = foreign_files(input_, map);
    for (const ForeignFile& file : files) require_no_input(output_, {file.path, map_});
    return import_mapped_log(files, map, output_);
  }
  if (!map.files.empty())
    throw FormatError(map_, "",
                      "key 'files' is for kind: log only; give the file on the command line");
  require_input();
  require_frf_output(output_);
  return write_imported(output_, mapped_frf(read_foreign_arrays(input_), map), input_, {});
}

void ImportCommand::require_input() const {
  if (input_.empty()) throw std::invalid_argument("FILE is missing; give the file to import");
}

void ImportCommand::run() const {
  if (output_.empty()) {
    require_input();
    return list();
  }
  ImportSummary summary;
  if (!map_.empty()) {
    summary = import_with_map();
  } else if (require_input(); is_uff_name(input_) && output_.extension() == ".json") {
    require_no_input(output_, {input_});
    write_modes(output_, candidates_of(input_, read_uff(input_)));
  } else {
    require_no_input(output_, {input_});
    require_frf_output(output_);
    std::vector<std::string> notes;
    FrfEstimate frf = read_foreign_frf(input_, output_, notes);
    summary = write_imported(output_, std::move(frf), input_, std::move(notes));
  }
  const auto bytes = std::filesystem::file_size(output_);
  for (const std::string& line : summary.lines) console_.result(line);
  console_.result(fmt::format("wrote {}, {} bytes", output_.string(), bytes));
  nlohmann::ordered_json json = {{"output", output_.string()}, {"bytes", bytes}};
  json.update(summary.json);
  console_.result(json);
}

}  // namespace

std::shared_ptr<void> import_command(CLI::App& app, Console& console) {
  return std::make_shared<ImportCommand>(app, console);
}

}  // namespace stageid
