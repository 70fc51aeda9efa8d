#pragma once

#include <hdf5.h>

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "acquisition/files/hdf5_file.hpp"

/// Shared by the implementation files of Hdf5File only.
namespace stageid::hdf5 {

/// The innermost reason of HDF5's error stack, on one line; clears the stack.
std::string take_reason();
/// The system's message on that stack as " (Input/output error)", empty if the system has none; clears the stack.
/// For files that are read: HDF5's own words describe its internals, not what to do.
std::string take_system_reason();

Hdf5Handle property_list(hid_t class_id);
Hdf5Handle complex_type(hid_t float_type);  ///< compound r, i
Hdf5Handle text_type(H5T_cset_t cset);      ///< variable length: h5py's str

Hdf5Kind kind_of(hid_t type);
std::string name_of(Hdf5Kind kind);

std::vector<hsize_t> shape_of(hid_t space);
std::string text_of(const std::vector<hsize_t>& shape);  ///< "4000 x 4 x 13"

/// The number of elements of `shape`, after checking that the file can contain them.
/// @throws FormatError if it cannot: the size is damaged.
std::size_t plausible_count(const std::filesystem::path& file, const std::string& place,
                            const std::vector<hsize_t>& shape, std::size_t element_bytes,
                            bool compressed);

/// An attribute or a dataset that is read, with its names for error messages.
struct StoredValue {
  const Hdf5File& file;
  std::string object;
  std::string subject;   ///< starts every message about it: "attribute 'unit' ", or nothing
  const char* damage;    ///< what may be wrong with a file that cannot be read
  Hdf5Handle type = {};  ///< of the file
  Hdf5Handle space = {};
  Hdf5Kind kind = Hdf5Kind::other;

  void set(Hdf5Handle stored_type, Hdf5Handle stored_space);
  [[noreturn]] void fail(const std::string& what) const;
  [[noreturn]] void fail_to_read() const;  ///< with HDF5's reason
  void expect(bool matches, const std::string& wanted) const;
  void expect_number(const std::string& wanted) const;
  /// `count` strings of fixed or variable length. `read(memory_type, buffer)` calls H5Dread or H5Aread.
  std::vector<std::string> read_texts(std::size_t count,
                                      const std::function<herr_t(hid_t, void*)>& read) const;
};

/// For H5Literate() and H5Aiterate(): appends the name to a list of texts.
template <typename Info>
herr_t collect_name(hid_t, const char* name, const Info*, void* names) {
  static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

/// Checks the global heaps of an HDF5 file, which contain texts of variable length.
///
/// HDF5 1.10 does not check them: a wrong length makes it read out of bounds or loop forever. Heaps are
/// written near the beginning or the end, so only the first and the last megabytes are searched.
/// @throws FormatError if a heap is damaged; FileError if the file cannot be read.
void check_global_heaps(const std::filesystem::path& file);

/// Visits every object, attribute and text of a file, so that a crash of HDF5 on a damaged one occurs here.
/// @throws FormatError if the file refers to other files (external links, external storage, virtual datasets), which
/// would show their contents as measured data, contains a group within itself, or has more than 20000 objects.
void survey(const Hdf5File& file);

}  // namespace stageid::hdf5
