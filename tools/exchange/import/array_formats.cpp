#include "tools/exchange/import/array_formats.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/file_kind.hpp"
#include "tools/exchange/arrays/csv_table.hpp"
#include "tools/exchange/arrays/npz_file.hpp"
#include "tools/exchange/matlab/mat_file.hpp"
#include "tools/exchange/uff/uff_frf.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {

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
  throw std::invalid_argument(fmt::format(
      "{}: unsupported file type '{}'; use .unv, .uff, .mat, .csv, .h5, .npz or .sNp (Touchstone)",
      file.string(), ending));
}

}  // namespace stageid
