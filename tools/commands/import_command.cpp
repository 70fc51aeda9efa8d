#include "tools/commands/commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <stdexcept>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_error.hpp"
#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/version.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/import/foreign_formats.hpp"
#include "tools/exchange/import/import_summary.hpp"
#include "tools/exchange/import/mapped_frf.hpp"
#include "tools/exchange/import/mapped_log.hpp"
#include "tools/exchange/import/si_unit.hpp"
#include "tools/exchange/model/mode_correlation.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// Checks the response. Keeps the provenance of a stageid file; otherwise the foreign file is the provenance.
ImportSummary write_imported(const std::filesystem::path& output, FrfEstimate frf,
                             const std::filesystem::path& input, std::vector<std::string> notes) {
  try {
    check(frf);
    take_si_units(frf, notes);
  } catch (const std::invalid_argument& error) {
    throw FormatError(input, "", error.what());
  }
  if (frf.provenance_json == "{}")
    frf.provenance_json = Json{
        {"imported", input.filename().string()},
        {"fingerprint", fingerprint_of_file(input)},
        {"version",
         version()}}.dump();
  write_frf(output, frf);
  return summary_of(frf, notes);
}

/// stageid import FILE.{unv,uff,mat,csv,h5,npz,sNp} -o frf.h5|run.slog [--map MAP.yaml]; without -o it lists the
/// content of the file.
struct ImportFlags {
  std::filesystem::path input;
  std::filesystem::path output;
  std::filesystem::path map;
};

void list_arrays(const ImportFlags& flags, Console& console) {
  if (!flags.map.empty()) fail_request("--map: needs an output file; add -o FILE");
  std::vector<std::vector<std::string>> rows = {{"array", "size", "holds"}};
  Json json = Json::array();
  const ArrayList arrays = read_foreign_arrays(flags.input);
  for (const NamedArray& array : arrays.arrays) {
    const char* holds = array.is_text() ? "text" : array.is_complex() ? "complex" : "real";
    rows.push_back({array.name, fmt::format("{}", fmt::join(array.shape, " x ")), holds});
    json.push_back({{"name", array.name}, {"size", array.shape}, {"holds", holds}});
  }
  for (const UnreadVariable& variable : arrays.unread) {
    rows.push_back({variable.name, "", variable.what});
    json.push_back({{"name", variable.name},
                    {"size", Json::array()},
                    {"holds", variable.what},
                    {"remedy", variable.remedy}});
  }
  for (const std::string& line : table_lines(rows)) console.result(line);
  for (const UnreadVariable& variable : arrays.unread)
    console.result("{}: {} cannot be read. {}", variable.name, variable.what, variable.remedy);
  console.result({{"arrays", json}});
}

void require_foreign_file(const ImportFlags& flags) {
  if (flags.input.empty()) fail_request("FILE is missing; give the file to import");
}

ImportSummary import_with_map(const ImportFlags& flags) {
  const ImportMap map = read_import_map(flags.map);
  if (map.kind == ImportMap::Kind::log) {
    const std::vector<ForeignFile> files = foreign_files(flags.input, map);
    for (const ForeignFile& file : files) require_no_input(flags.output, {file.path, flags.map});
    return import_mapped_log(files, map, flags.output);
  }
  if (!map.files.empty())
    throw FormatError(flags.map, "",
                      "key 'files' is for kind: log only; give the file on the command line");
  require_foreign_file(flags);
  require_frf_ending(flags.output);
  return write_imported(flags.output, mapped_frf(read_foreign_arrays(flags.input), map),
                        flags.input, {});
}

void import_file(const ImportFlags& flags, Console& console) {
  if (flags.output.empty()) {
    require_foreign_file(flags);
    return list_arrays(flags, console);
  }
  ImportSummary summary;
  if (!flags.map.empty()) {
    summary = import_with_map(flags);
  } else if (require_foreign_file(flags);
             is_uff_name(flags.input) && flags.output.extension() == ".json") {
    require_no_input(flags.output, {flags.input});
    write_modes(flags.output, candidates_of(flags.input, read_uff(flags.input)));
  } else {
    require_no_input(flags.output, {flags.input});
    require_frf_ending(flags.output);
    std::vector<std::string> notes;
    FrfEstimate frf = read_foreign_frf(flags.input, flags.output, notes);
    summary = write_imported(flags.output, std::move(frf), flags.input, std::move(notes));
  }
  const auto bytes = std::filesystem::file_size(flags.output);
  for (const std::string& line : summary.lines) console.result(line);
  console.result("wrote {}, {} bytes", flags.output.string(), bytes);
  Json json = {{"output", flags.output.string()}, {"bytes", bytes}};
  json.update(summary.json);
  console.result(json);
}

}  // namespace

void import_command(CLI::App& app, Console& console) {
  auto [command, flags] =
      add_command(app, console, "import",
                  "Import a frequency response or a log written by another program", import_file);
  command.add_option("file", flags.input,
                     "foreign file: .unv, .uff, .mat, .csv, .h5, .npz, .sNp (Touchstone); for a "
                     "log also a pattern such as 'run_{realization}_{experiment}.mat'");
  command.add_option(
      "-o,--output", flags.output,
      "file to write: frf.h5; run.slog or run.h5 for a log; modes.json for the mode shapes of a "
      "universal file. Default: list the arrays of the file, to help you write a map");
  command.add_option(
      "--map", flags.map,
      "YAML file that assigns the arrays (docs/exchange.md); needed for a foreign .mat, .npz, .csv "
      "or .h5");
}

}  // namespace stageid
