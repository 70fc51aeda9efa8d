#pragma once

#include <hdf5.h>

#include <complex>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace stageid {

/// One HDF5 handle and the function that closes it.
class Hdf5Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Hdf5Handle() = default;
  Hdf5Handle(hid_t id, Close closer) noexcept : id_(id), close_(closer) {}
  ~Hdf5Handle() { reset(); }
  Hdf5Handle(Hdf5Handle&& other) noexcept { swap(other); }
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    swap(other);
    return *this;
  }
  hid_t get() const noexcept { return id_; }
  explicit operator bool() const noexcept { return id_ >= 0; }
  void reset() noexcept { static_cast<void>(close()); }
  /// False if HDF5 could not write what it still held back. Only what was written needs the answer.
  [[nodiscard]] bool close() noexcept {
    const bool closed = id_ < 0 || close_(id_) >= 0;
    id_ = -1;
    return closed;
  }

 private:
  void swap(Hdf5Handle& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
  }
  hid_t id_ = -1;
  Close close_ = nullptr;
};

/// Element types that stageid distinguishes.
enum class Hdf5Kind : std::uint8_t { real, integer, complex, text, other };

/// A thin layer over the HDF5 C library for the types in stageid's files. It checks shapes and names file and
/// dataset in every error. Paths are absolute ("/runs/0000/sensors").
///
/// Reading: a missing object or a wrong type or shape is a FormatError. An unreadable file is a FileError
/// (missing) or a FormatError (not HDF5, truncated). A shape larger than the file can contain is a FormatError
/// too, so that a damaged size cannot exhaust the memory. Writing: FileError. Concurrent use: Debian's HDF5 is
/// not thread-safe, so only one thread of the program may use it at a time.
class Hdf5File {
 public:
  static Hdf5File open(const std::filesystem::path& file);  ///< read-only
  /// Truncates. Stores no times, so that the same content gives the same bytes. Errors name `shown_as` if
  /// given: the target of an OutputFile instead of its temporary file.
  static Hdf5File create(const std::filesystem::path& file,
                         const std::filesystem::path& shown_as = {});
  ~Hdf5File();
  Hdf5File(Hdf5File&&) noexcept;
  Hdf5File& operator=(Hdf5File&&) noexcept;

  const std::filesystem::path& path() const noexcept { return path_; }
  bool exists(const std::string& object) const;
  bool has_attribute(const std::string& object, const std::string& name) const;
  bool is_group(const std::string& object) const;
  std::vector<std::string> children(const std::string& group) const;     ///< by name; names only
  std::vector<std::string> attributes(const std::string& object) const;  ///< by name; names only
  std::vector<hsize_t> shape(const std::string& dataset) const;
  Hdf5Kind kind(const std::string& dataset) const;  ///< a bool counts as integer
  Hdf5Kind attribute_kind(const std::string& object, const std::string& name) const;
  hid_t id() const noexcept { return file_.get(); }

  // Attributes: object "/" is the root. Integers may be stored as floats and vice versa.
  double read_real_attribute(const std::string& object, const std::string& name) const;
  long long read_integer_attribute(const std::string& object, const std::string& name) const;
  std::string read_text_attribute(const std::string& object, const std::string& name) const;
  /// A numeric attribute of one or more numbers.
  std::vector<double> read_reals_attribute(const std::string& object,
                                           const std::string& name) const;
  /// A string attribute of one or more strings, fixed or variable length.
  std::vector<std::string> read_texts_attribute(const std::string& object,
                                                const std::string& name) const;
  void write_attribute(const std::string& object, const std::string& name, double value);
  void write_attribute(const std::string& object, const std::string& name, long long value);
  void write_attribute(const std::string& object, const std::string& name,
                       const std::string& value);
  void write_attribute(const std::string& object, const std::string& name,
                       const std::vector<std::string>& values);
  void write_attribute(const std::string& object, const std::string& name,
                       const std::vector<double>& values);

  // Datasets. Numeric data are row-major (C order), as in HDF5. NaN is not checked here.
  std::vector<double> read_reals(const std::string& dataset) const;  ///< any shape
  std::vector<std::complex<double>> read_complex(
      const std::string& dataset) const;                                  ///< compound r, i
  std::vector<std::string> read_texts(const std::string& dataset) const;  ///< 1-D
  /// Rows [first, first + count) of a 1-D or 2-D dataset as float64, row-major, into `out`.
  void read_rows(const std::string& dataset, hsize_t first, hsize_t count, double* out) const;

  /// A box of a dataset, row-major: `extent` indices from `first` on of every dimension, real or complex numbers.
  template <typename Scalar>
  void read_box(const std::string& dataset, const std::vector<hsize_t>& first,
                const std::vector<hsize_t>& extent, Scalar* out) const;
  /// Rows that are stored together, which should be read together; 1: any.
  hsize_t rows_of_chunk(const std::string& dataset) const;

  void create_group(const std::string& group);
  void write_reals(const std::string& dataset, const std::vector<hsize_t>& shape,
                   const double* data);
  void write_complex(const std::string& dataset, const std::vector<hsize_t>& shape,
                     const std::complex<double>* data);
  void write_integers(const std::string& dataset, const std::vector<hsize_t>& shape,
                      const long long* data);
  void write_texts(const std::string& dataset, const std::vector<std::string>& values);
  /// An empty chunked dataset of `columns` columns (0: 1-D) that append_rows() extends.
  void create_growing(const std::string& dataset, hsize_t columns, hid_t file_type,
                      hsize_t chunk_rows);
  void append_rows(const std::string& dataset, hsize_t count, const double* data);
  void append_rows(const std::string& dataset, hsize_t count, const unsigned char* data);

  /// Flushes and closes; @throws FileError if anything could not be written. Needed after writing.
  void close();

 private:
  struct OpenDatasets;
  Hdf5File(std::filesystem::path path, Hdf5Handle file);
  static Hdf5File opened(const std::filesystem::path& file);
  hid_t open_dataset(const std::string& dataset) const;
  void check_chunk(const std::string& dataset, hid_t id) const;
  void write_dataset(const std::string& dataset, const std::vector<hsize_t>& shape, hid_t file_type,
                     hid_t memory_type, const void* data);
  void append(const std::string& dataset, hsize_t count, hid_t memory_type, const void* data);

  std::filesystem::path path_;
  Hdf5Handle file_;
  std::unique_ptr<OpenDatasets> open_datasets_;  ///< destroyed before file_
};

}  // namespace stageid
