#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

enum class MatVersion : std::uint8_t {
  v5,  ///< what every program reads; at most 2 GiB a variable
  v73  ///< HDF5 inside
};

/// Writes a MATLAB file, whole or not at all: same content, same bytes (v5). Lists of arrays are written
/// as they come, and need not be kept.
///
/// "modes/damping_ratio" becomes field damping_ratio of struct modes, "inputs@unit" a variable
/// inputs_unit, "@format" a variable format; a name that begins with a digit gets an x in front. Lists
/// of texts are cells of text, single texts are text, one-dimensional arrays columns. Arrays of three
/// axes, N x a x b, are a x b x N, as MATLAB counts pages: what idfrd(response, frequency, ...) wants.
/// @throws FileError
/// @throws std::invalid_argument if an array is too large for v5; v7.3 is the remedy.
class MatWriter {
 public:
  MatWriter(const std::filesystem::path& file, MatVersion version);
  ~MatWriter();
  MatWriter(const MatWriter&) = delete;
  MatWriter& operator=(const MatWriter&) = delete;

  /// Structs are whole: all of their fields are in one list.
  void add(const ArrayList& list);
  /// The file appears. Without it none does.
  void close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// All at once.
void write_mat(const std::filesystem::path& file, const ArrayList& list,
               MatVersion version = MatVersion::v5);

/// Reads any MATLAB file that libmatio does: v4, v5, v7 and v7.3. Numbers of every class are doubles;
/// shapes are MATLAB's; fields of scalar structs are "struct/field", of struct arrays "struct/0/field".
/// Sparse matrices become full ones. Function handles and objects, tables among them, are ArrayList::unread.
/// @throws FileError, FormatError
ArrayList read_mat(const std::filesystem::path& file);

}  // namespace stageid
