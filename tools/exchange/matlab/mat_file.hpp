#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "acquisition/files/output_file.hpp"
#include "excitation/words/words.hpp"
#include "tools/exchange/matlab/mat_variable.hpp"

namespace stageid {

enum class MatVersion : std::uint8_t {
  v5,  ///< readable by every program; at most 2 GiB per variable
  v73  ///< based on HDF5
};
template <>
inline constexpr std::array kWords<MatVersion> = {"5", "7.3"};

/// Writes a MATLAB file atomically; equal content gives equal bytes (v5). Lists of arrays are written immediately and
/// need not be kept.
///
/// "modes/damping_ratio" becomes field damping_ratio of struct modes, "inputs@unit" a variable
/// inputs_unit, "@format" a variable format; a name that begins with a digit gets a leading x. Lists of texts
/// are cells of text, single texts are text, one-dimensional arrays columns. Arrays with three axes,
/// N x a x b, become a x b x N, the order of MATLAB pages, as required by idfrd(response, frequency, ...).
/// @throws FileError
/// @throws std::invalid_argument if an array is too large for v5; use v7.3.
class MatWriter {
 public:
  MatWriter(const std::filesystem::path& file, MatVersion version);

  /// All fields of a struct must be in one list.
  void add(const ArrayList& list);
  /// Completes the file. Without this call, no file is created.
  void close();

 private:
  MatVersion version_;
  OutputFile output_;
  std::optional<Mat73File> hdf5_;
};

/// Writes a file in one call.
void write_mat(const std::filesystem::path& file, const ArrayList& list,
               MatVersion version = MatVersion::v5);

/// Reads any MATLAB file that libmatio supports: v4, v5, v7 and v7.3. Numbers of every class become doubles, with the
/// shapes of MATLAB. Fields of scalar structs are "struct/field", those of struct arrays "struct/0/field". Sparse
/// matrices become full ones. Function handles and objects, including tables, are listed in ArrayList::unread.
/// @throws FileError, FormatError
ArrayList read_mat(const std::filesystem::path& file);

}  // namespace stageid
