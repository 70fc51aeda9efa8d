#include "acquisition/files/hdf5_support.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "acquisition/files/fail.hpp"

namespace stageid::hdf5 {
namespace {

herr_t keep_innermost(unsigned depth, const H5E_error2_t* error, void* reason) {
  if (depth == 0 && error->desc != nullptr) *static_cast<std::string*>(reason) = error->desc;
  return 0;
}

/// HDF5 describes a failing system call in several lines with addresses; only its message is kept.
constexpr std::string_view kSystemMessage = "error message = '";

std::string on_one_line(const std::string& innermost) {
  std::string reason = innermost;
  if (const auto start = reason.find(kSystemMessage); start != std::string::npos) {
    reason.erase(0, start + kSystemMessage.size());
    reason.erase(std::min(reason.find('\''), reason.size()));
  }
  std::replace_if(
      reason.begin(), reason.end(), [](unsigned char c) { return c < ' '; }, ' ');
  return reason.empty() ? "unknown reason" : reason;
}

std::string take_innermost() {
  std::string reason;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_innermost, &reason);
  H5Eclear2(H5E_DEFAULT);
  return reason;
}

}  // namespace

std::string take_reason() { return on_one_line(take_innermost()); }

std::string take_system_reason() {
  std::string reason = take_innermost();
  if (reason.find(kSystemMessage) == std::string::npos) return "";
  return fmt::format(" ({})", on_one_line(reason));
}

Hdf5Handle property_list(hid_t class_id) { return {H5Pcreate(class_id), H5Pclose}; }

Hdf5Handle complex_type(hid_t float_type) {
  const std::size_t part = H5Tget_size(float_type);
  Hdf5Handle type(H5Tcreate(H5T_COMPOUND, 2 * part), H5Tclose);
  H5Tinsert(type.get(), "r", 0, float_type);
  H5Tinsert(type.get(), "i", part, float_type);
  return type;
}

Hdf5Handle text_type(H5T_cset_t cset) {
  Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.get(), H5T_VARIABLE);
  H5Tset_cset(type.get(), cset);
  return type;
}

Hdf5Kind kind_of(hid_t type) {
  switch (H5Tget_class(type)) {
    case H5T_FLOAT:
      return Hdf5Kind::real;
    case H5T_INTEGER:
    case H5T_ENUM:  // h5py stores numpy.bool_ as an enumeration of FALSE and TRUE
      return Hdf5Kind::integer;
    case H5T_STRING:
      return Hdf5Kind::text;
    case H5T_COMPOUND: {
      const int real = H5Tget_member_index(type, "r");
      const int imaginary = H5Tget_member_index(type, "i");
      const bool complex = H5Tget_nmembers(type) == 2 && real >= 0 && imaginary >= 0 &&
                           H5Tget_member_class(type, static_cast<unsigned>(real)) == H5T_FLOAT &&
                           H5Tget_member_class(type, static_cast<unsigned>(imaginary)) == H5T_FLOAT;
      H5Eclear2(H5E_DEFAULT);
      return complex ? Hdf5Kind::complex : Hdf5Kind::other;
    }
    default:
      return Hdf5Kind::other;
  }
}

std::string name_of(Hdf5Kind kind) {
  constexpr std::array kNames = {"real numbers", "integers", "complex numbers", "text",
                                 "data of an unsupported type"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::vector<hsize_t> shape_of(hid_t space) {
  const int rank = H5Sget_simple_extent_ndims(space);
  std::vector<hsize_t> shape(std::max(rank, 0));
  if (rank > 0) H5Sget_simple_extent_dims(space, shape.data(), nullptr);
  return shape;
}

std::string text_of(const std::vector<hsize_t>& shape) {
  return shape.empty() ? "one value" : fmt::format("{}", fmt::join(shape, " x "));
}

std::size_t plausible_count(const std::filesystem::path& file, const std::string& place,
                            const std::vector<hsize_t>& shape, std::size_t element_bytes,
                            bool compressed) {
  // deflate compresses at most 1032 to 1. Small datasets may have no bytes in the file (fill value).
  constexpr std::uintmax_t kGreatestCompression = 1100;
  constexpr std::uintmax_t kAlwaysAllowed = std::uintmax_t{1} << 26;
  std::error_code ignored;
  const std::uintmax_t file_bytes = std::filesystem::file_size(file, ignored);
  std::uintmax_t limit = kAlwaysAllowed;
  if (!ignored) limit += file_bytes * (compressed ? kGreatestCompression : 1);

  std::uintmax_t bytes = std::max<std::size_t>(element_bytes, 1);
  if (std::find(shape.begin(), shape.end(), hsize_t{0}) != shape.end()) return 0;
  std::size_t count = 1;
  for (const hsize_t extent : shape) {
    if (extent > limit / bytes)
      fail_format(file, place,
                  "has the size {}, which exceeds the size of the file; the file is damaged",
                  text_of(shape));
    bytes *= extent;
    count *= static_cast<std::size_t>(extent);
  }
  return count;
}

void StoredValue::set(Hdf5Handle stored_type, Hdf5Handle stored_space) {
  type = std::move(stored_type);
  space = std::move(stored_space);
  if (!type || !space)
    fail("cannot be read" + take_system_reason() + "; the file is damaged, copy it again");
  kind = kind_of(type.get());
}

void StoredValue::fail(const std::string& what) const {
  throw FormatError(file.path(), object, subject + what);
}

void StoredValue::fail_to_read() const {
  fail("cannot be read" + take_system_reason() + "; the file is " + damage + ", copy it again");
}

void StoredValue::expect(bool matches, const std::string& wanted) const {
  if (!matches) fail("contains " + name_of(kind) + "; expected " + wanted);
}

void StoredValue::expect_number(const std::string& wanted) const {
  expect(kind == Hdf5Kind::real || kind == Hdf5Kind::integer, wanted);
}

std::vector<std::string> StoredValue::read_texts(
    std::size_t count, const std::function<herr_t(hid_t, void*)>& read) const {
  std::vector<std::string> texts;
  if (count == 0) return texts;
  texts.reserve(count);
  if (H5Tis_variable_str(type.get()) > 0) {
    const Hdf5Handle memory = text_type(H5Tget_cset(type.get()));
    std::vector<char*> pointers(count, nullptr);
    const bool done = read(memory.get(), pointers.data()) >= 0;
    if (done)
      for (const char* pointer : pointers) texts.emplace_back(pointer != nullptr ? pointer : "");
    H5Dvlen_reclaim(memory.get(), space.get(), H5P_DEFAULT, pointers.data());
    if (!done) fail_to_read();
    return texts;
  }
  const std::size_t size = H5Tget_size(type.get());
  std::vector<char> buffer(count * size);
  if (read(type.get(), buffer.data()) < 0) fail_to_read();
  const bool space_padded = H5Tget_strpad(type.get()) == H5T_STR_SPACEPAD;
  for (std::size_t i = 0; i < count; ++i) {
    const char* start = buffer.data() + i * size;
    std::string text(start, ::strnlen(start, size));
    if (space_padded) text.erase(text.find_last_not_of(' ') + 1);
    texts.push_back(std::move(text));
  }
  return texts;
}

}  // namespace stageid::hdf5
