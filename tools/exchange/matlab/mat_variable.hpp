#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {

/// A variable as it is written to a MATLAB file: an array, or a struct with fields.
struct MatVariable {
  std::string name;
  const NamedArray* array = nullptr;  ///< null: a struct
  std::vector<MatVariable> fields;
};

/// A variable of a v5 file: an element with its tag.
/// Source: MathWorks, MAT-File Format, 2022, chapter 1 (Level 5).
std::string mat5_element(const MatVariable& variable);

/// The variables of a v7.3 file: HDF5 with attributes that name MATLAB's classes.
class Mat73File {
 public:
  /// @param shown_as for errors @throws FileError, as the others do
  Mat73File(const std::filesystem::path& file, const std::filesystem::path& shown_as);
  ~Mat73File();
  Mat73File(Mat73File&&) = delete;

  void add(const MatVariable& variable);
  /// @param head the bytes before the HDF5 part
  void close(std::string_view head);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// In the order of MATLAB and with at least two axes: its last index varies slowest.
NamedArray as_matlab_stores(const NamedArray& array);

}  // namespace stageid
