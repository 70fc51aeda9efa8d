#include "tools/import_command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "excitation/file_error.hpp"
#include "excitation/file_kind.hpp"
#include "excitation/fingerprint.hpp"
#include "frf/frf_file.hpp"
#include "tools/command_line.hpp"
#include "tools/csv_table.hpp"
#include "tools/frf_arrays.hpp"
#include "tools/import_frf.hpp"
#include "tools/import_log.hpp"
#include "tools/mat_file.hpp"
#include "tools/mode_correlation.hpp"
#include "tools/npz_file.hpp"
#include "tools/output_paths.hpp"
#include "tools/touchstone_reader.hpp"
#include "tools/uff_frf.hpp"

namespace stageid {
namespace {

ArrayList read_arrays(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".mat") return read_mat(file);
  if (ending == ".npz") return read_npz(file);
  if (ending == ".csv" || ending == ".txt" || ending == ".dat") return read_csv(file);
  if (ending == ".h5" || ending == ".hdf5") return read_hdf5_arrays(file);
  if (is_uff_name(file)) return arrays_of_uff(file, read_uff(file));
  require_readable(file);
  if (const std::string other = other_kind(file, "a file of another program"); !other.empty())
    throw FormatError(file, "", other);
  throw std::invalid_argument(
      fmt::format("{}: '{}' is not imported; there are .unv, .uff, .mat, .csv, .h5, .npz and .sNp "
                  "(Touchstone)",
                  file.string(), ending));
}

[[noreturn]] void ask_for_map(const ArrayList& arrays) {
  std::string shown;
  constexpr std::size_t kMost = 6;
  for (std::size_t k = 0; k < arrays.arrays.size() && k < kMost; ++k)
    shown += (k == 0 ? "" : ", ") + arrays.arrays[k].name;
  throw FormatError(
      arrays.file, "",
      fmt::format(
          "does not say what its {} arrays ({}{}) are; write a map with kind: frf or "
          "kind: log (docs/exchange.md) and give it with --map; 'stageid import {}' lists them",
          arrays.arrays.size(), shown, arrays.arrays.size() > kMost ? ", ..." : "",
          arrays.file.string()));
}

void require_frf_output(const std::filesystem::path& output) {
  if (output.extension() != ".h5" && output.extension() != ".hdf5")
    throw std::invalid_argument(
        fmt::format("{}: a frequency response is imported as .h5, not as '{}'", output.string(),
                    output.extension().string()));
}

FrfEstimate read_foreign_frf(const std::filesystem::path& file,
                             const std::filesystem::path& output) {
  if (is_touchstone(file)) return read_touchstone(file);
  if (is_uff_name(file)) return frf_of_uff(file, read_uff(file));
  const ArrayList arrays = read_arrays(file);
  if (!holds_frf(arrays)) ask_for_map(arrays);
  return frf_of_arrays(arrays, output);
}

}  // namespace

namespace {

/// What came with its history keeps it; else the foreign file is the history.
void write_imported(const std::filesystem::path& output, FrfEstimate frf,
                    const std::filesystem::path& input) {
  if (frf.provenance_json == "{}")
    frf.provenance_json = nlohmann::ordered_json{
        {"imported", input.filename().string()},
        {"fingerprint", fingerprint_of_file(input)},
        {"version",
         STAGEID_VERSION}}.dump();
  write_frf(output, frf);
}

}  // namespace

ImportCommand::ImportCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command =
      add_command(app, "import", "Read a frequency response or a log that another program wrote");
  command
      ->add_option("file", input_,
                   "foreign file: .unv, .uff, .mat, .csv, .h5, .npz, .sNp (Touchstone)")
      ->required();
  command->add_option("-o,--output", output_,
                      "frf.h5, or of a log run.slog or run.h5, or of the modes of a universal file "
                      "modes.json for 'fit --modes'; without it the file's arrays are listed, "
                      "which is what a map is written from");
  command->add_option("--map", map_,
                      "YAML file that tells which arrays are what; needed where the file does not");
  command->final_callback([this] { run(); });
}

void ImportCommand::list() const {
  if (!map_.empty())
    throw std::invalid_argument("--map: the file to write is missing; give it with -o");
  std::vector<std::vector<std::string>> rows = {{"array", "size", "holds"}};
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const NamedArray& array : read_arrays(input_).arrays) {
    const char* holds = array.is_text() ? "text" : array.is_complex() ? "complex" : "real";
    rows.push_back({array.name, fmt::format("{}", fmt::join(array.shape, " x ")), holds});
    json.push_back({{"name", array.name}, {"size", array.shape}, {"holds", holds}});
  }
  for (const std::string& line : table_lines(rows)) console_.result(line);
  console_.result({{"arrays", json}});
}

void ImportCommand::run() const {
  if (output_.empty()) return list();
  require_no_input(output_, {input_, map_});
  if (is_uff_name(input_) && output_.extension() == ".json") {
    write_modes(output_, candidates_of(input_, read_uff(input_)));
  } else if (map_.empty()) {
    require_frf_output(output_);
    write_imported(output_, read_foreign_frf(input_, output_), input_);
  } else {
    const ImportMap map = read_import_map(map_);
    if (map.kind == ImportMap::Kind::log) {
      import_log(read_arrays(input_), map, output_);
    } else {
      require_frf_output(output_);
      write_imported(output_, import_frf(read_arrays(input_), map), input_);
    }
  }
  const auto bytes = std::filesystem::file_size(output_);
  console_.result(fmt::format("wrote {}, {} bytes", output_.string(), bytes));
  console_.result({{"output", output_.string()}, {"bytes", bytes}});
}

}  // namespace stageid
