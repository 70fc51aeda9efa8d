#include "tools/exchange/import/foreign_formats.hpp"

#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_kind.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/exchange/arrays/frf_arrays.hpp"
#include "tools/exchange/arrays/frf_csv.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/exchange/arrays/touchstone_reader.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/exchange/uff/uff_frf.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

[[noreturn]] void ask_for_map(const ArrayList& arrays) {
  arrays.fail(
      "",
      "the meaning of its {} arrays ({}) is unknown; write a map with kind: frf or kind: log "
      "(docs/exchange.md) and pass it with --map; 'stageid import {}' lists the arrays",
      arrays.arrays.size(), listed(arrays.names(), 6), arrays.file.string());
}

}  // namespace

ArrayList read_foreign_arrays(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  if (ending == ".mat") return read_mat(file);
  if (ending == ".npz") return read_npz(file);
  if (ending == ".csv" || ending == ".txt" || ending == ".dat") return read_csv(file);
  if (ending == ".h5" || ending == ".hdf5") return read_hdf5_arrays(file);
  if (is_uff_name(file)) return arrays_of_uff(file, read_uff(file));
  require_readable(file);
  if (const std::string other = other_kind(file, "a file of another program"); !other.empty())
    throw FormatError(file, "", other);
  fail_request(
      "{}: unsupported file type '{}'; use .unv, .uff, .mat, .csv, .h5, .npz or .sNp (Touchstone)",
      file.string(), ending);
}

FrfEstimate read_foreign_frf(const std::filesystem::path& file, const std::filesystem::path& output,
                             std::vector<std::string>& notes) {
  if (is_touchstone(file)) {
    TouchstoneFrf touchstone = read_touchstone(file);
    if (!touchstone.note.empty()) notes.push_back(touchstone.note);
    return std::move(touchstone.frf);
  }
  if (is_frf_csv(file)) return read_frf_csv(file);
  if (is_uff_name(file)) return frf_of_uff(file, read_uff(file));
  const ArrayList arrays = read_foreign_arrays(file);
  if (!holds_frf(arrays)) ask_for_map(arrays);
  return frf_of_arrays(arrays, output);
}

}  // namespace stageid
