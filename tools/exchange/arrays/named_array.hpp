#pragma once

#include <complex>
#include <cstddef>
#include <filesystem>
#include <string>
#include <variant>
#include <vector>

namespace stageid {

/// An array (C order: the last index runs fastest) or a list of texts, as files of any format hold it.
///
/// Names are paths without the first slash: "modes/damping_ratio"; "inputs@unit" is the attribute
/// `unit` of the object `inputs`, "@format" one of the file itself. A single value has no shape.
struct NamedArray {
  using Values = std::variant<std::vector<double>, std::vector<std::complex<double>>,
                              std::vector<std::string>>;
  std::string name;
  std::vector<std::size_t> shape;
  Values values;

  bool is_text() const noexcept { return values.index() == 2; }
  bool is_complex() const noexcept { return values.index() == 1; }
  std::size_t size() const;
};

/// A variable that cannot be read, for listings and errors.
struct UnreadVariable {
  std::string name;
  std::string what;    ///< "MATLAB object (table)"
  std::string remedy;  ///< "Save its columns as arrays in MATLAB: ..."
};

/// The arrays of one file, in its order.
struct ArrayList {
  std::filesystem::path file;  ///< for errors
  std::vector<NamedArray> arrays;
  std::vector<UnreadVariable> unread = {};

  /// By name; a leading slash may be there, and dots may stand for slashes. Null if there is none.
  const NamedArray* find(const std::string& name) const;
  /// @throws FormatError that lists the names there are.
  const NamedArray& at(const std::string& name) const;
};

/// The array with axis q of the result the axis `axes[q]` of `array`, e.g. {1, 2, 0} of N x a x b gives
/// a x b x N.
/// @throws std::invalid_argument unless `axes` is a permutation of the array's axes.
NamedArray permuted(const NamedArray& array, const std::vector<std::size_t>& axes);

/// All axes in reverse: C order of the result is column-major order of `array`.
NamedArray reversed(const NamedArray& array);

/// @throws FormatError naming the file if the array holds texts or, for real_values(), complex numbers.
std::vector<double> real_values(const ArrayList& list, const NamedArray& array);
std::vector<std::complex<double>> complex_values(const ArrayList& list, const NamedArray& array);
std::vector<std::string> text_values(const ArrayList& list, const NamedArray& array);

/// Every dataset and attribute of an HDF5 file; integers as doubles. Datasets that are neither numbers nor
/// lists of texts are left out.
/// @throws FileError, FormatError
ArrayList read_hdf5_arrays(const std::filesystem::path& file);

/// The reverse; a text attribute of several values and numeric attributes included. Whole or not at all.
/// @throws FileError
void write_hdf5_arrays(const std::filesystem::path& file, const ArrayList& list);

}  // namespace stageid
