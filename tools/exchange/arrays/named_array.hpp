#pragma once

#include <fmt/format.h>

#include <complex>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "acquisition/files/fail.hpp"

namespace stageid {

/// An array (C order: the last index varies fastest) or a list of texts, independent of the file format.
///
/// Names are paths without the leading slash: "modes/damping_ratio"; "inputs@unit" is the attribute `unit` of the
/// object `inputs`, "@format" one of the file itself. A single value has an empty shape.
struct NamedArray {
  using Values = std::variant<std::vector<double>, std::vector<std::complex<double>>,
                              std::vector<std::string>>;
  std::string name;
  std::vector<std::size_t> shape;
  Values values;

  bool is_text() const noexcept { return values.index() == 2; }
  bool is_complex() const noexcept { return values.index() == 1; }
  std::size_t size() const;
  bool is_vector() const noexcept;  ///< at most one axis has a length other than one
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

  /// Finds an array by name. A leading slash is accepted, and dots instead of slashes. Null if not found.
  const NamedArray* find(const std::string& name) const;
  /// @throws FormatError that lists the available names.
  const NamedArray& at(const std::string& name) const;
  std::vector<std::string> names() const;
  /// @throws FormatError naming the file and `place`, always
  template <typename... Parts>
  [[noreturn]] void fail(const std::string& place, fmt::format_string<Parts...> what,
                         Parts&&... parts) const {
    fail_format(file, place, what, std::forward<Parts>(parts)...);
  }
};

/// Axis q of the result is axis `axes[q]` of `array`, e.g. {1, 2, 0} of N x a x b gives a x b x N.
/// @throws std::invalid_argument unless `axes` is a permutation of the array's axes.
NamedArray permuted(const NamedArray& array, const std::vector<std::size_t>& axes);

/// All axes in reverse: C order of the result is column-major order of `array`.
NamedArray reversed(const NamedArray& array);

/// @throws FormatError naming the file if the array has texts or, for real_values(), complex numbers.
const std::vector<double>& real_values(const ArrayList& list, const NamedArray& array);
std::vector<std::complex<double>> complex_values(const ArrayList& list, const NamedArray& array);

/// Reads a file in a child process (in_child), for the libraries that crash on damaged files.
/// @throws FileError, FormatError
ArrayList arrays_in_child(const std::filesystem::path& file,
                          const std::function<ArrayList(const std::filesystem::path&)>& read);

/// Every dataset and attribute of an HDF5 file; integers as doubles. Datasets that are neither numbers nor lists of
/// texts are skipped.
/// @throws FileError, FormatError
ArrayList read_hdf5_arrays(const std::filesystem::path& file);

/// The reverse, including text attributes of several values and numeric attributes. The file is replaced atomically.
/// @throws FileError
void write_hdf5_arrays(const std::filesystem::path& file, const ArrayList& list);

}  // namespace stageid
