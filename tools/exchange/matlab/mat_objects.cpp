#include "tools/exchange/matlab/mat_objects.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/hdf5_file.hpp"
#include "acquisition/files/input_files.hpp"

namespace stageid {
namespace {

constexpr std::uint32_t kMatrix = 14, kCompressed = 15;
constexpr std::uint32_t kOpaqueClass = 17;

std::uint32_t word_at(std::string_view bytes, std::size_t at, bool big_endian) {
  std::uint32_t word = 0;
  for (unsigned k = 0; k < 4; ++k)
    word |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + k]))
            << (8 * (big_endian ? 3 - k : k));
  return word;
}

/// The elements of a variable, up to the first incomplete one.
class Elements {
 public:
  Elements(std::string_view bytes, bool big_endian) : bytes_(bytes), big_endian_(big_endian) {}

  std::optional<std::string_view> next() {
    if (at_ + 8 > bytes_.size()) return std::nullopt;
    const std::uint32_t type = word_at(bytes_, at_, big_endian_);
    // Up to four bytes of data are in the tag itself, their number in its upper half.
    const std::size_t small = type >> 16U;
    const std::size_t size = small > 0 ? small : word_at(bytes_, at_ + 4, big_endian_);
    const std::size_t start = at_ + (small > 0 ? 4 : 8);
    if (small > 4 || size > bytes_.size() - start) return std::nullopt;
    at_ = small > 0 ? at_ + 8 : start + (size + 7) / 8 * 8;
    return bytes_.substr(start, size);
  }

 private:
  std::string_view bytes_;
  bool big_endian_;
  std::size_t at_ = 0;
};

/// The first bytes of a deflated variable, which contain names and classes.
std::string inflated_begin(std::string_view deflated) {
  std::array<char, 1024> begin{};
  z_stream stream = {};
  if (inflateInit(&stream) != Z_OK) throw std::bad_alloc();
  // zlib does not write to its input; its interface merely lacks const.
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(deflated.data()));
  stream.avail_in = static_cast<uInt>(deflated.size());
  stream.next_out = reinterpret_cast<Bytef*>(begin.data());
  stream.avail_out = static_cast<uInt>(begin.size());
  inflate(&stream, Z_SYNC_FLUSH);
  const std::size_t size = begin.size() - stream.avail_out;
  inflateEnd(&stream);
  return {begin.data(), size};
}

std::optional<UnreadVariable> object_of(std::string_view variable, bool big_endian) {
  if (variable.size() < 8 || word_at(variable, 0, big_endian) != kMatrix) return std::nullopt;
  Elements elements(variable.substr(8), big_endian);
  const auto flags = elements.next();
  if (!flags || flags->size() < 4 || (word_at(*flags, 0, big_endian) & 0xffU) != kOpaqueClass)
    return std::nullopt;
  const auto name = elements.next();
  elements.next();  // the object system: MCOS or java
  const auto object_class = elements.next();
  if (!name || !object_class) return std::nullopt;
  return unread_object(std::string(*name), std::string(*object_class));
}

bool is_read(const ArrayList& list, const std::string& name) {
  const auto matches = [&](const auto& item) {
    return item.name == name || (item.name.size() > name.size() && item.name.starts_with(name) &&
                                 item.name[name.size()] == '/');
  };
  return std::any_of(list.arrays.begin(), list.arrays.end(), matches) ||
         std::any_of(list.unread.begin(), list.unread.end(), matches);
}

std::string class_of(const Hdf5File& file, const std::string& object) {
  if (!file.has_attribute(object, "MATLAB_class")) return "";
  return file.read_text_attribute(object, "MATLAB_class");
}

void require_all_of(const Hdf5File& file, const std::string& group, int depth, ArrayList& list) {
  if (depth > kDeepest) return;
  for (const std::string& child : file.children(group == "/" ? "/" : group)) {
    if (child.starts_with('#')) continue;  // targets of references, and the data of objects
    const std::string object = fmt::format("{}/{}", group == "/" ? "" : group, child);
    const std::string name = object.substr(1);
    const std::string kind = class_of(file, object);
    const bool sparse = file.has_attribute(object, "MATLAB_sparse");
    const bool nested = file.is_group(object) && !sparse;
    if (kind == "function_handle") {
      list.unread.push_back({name, "function handle", "Save its values as an array"});
    } else if (file.has_attribute(object, "MATLAB_object_decode") && !is_read(list, name)) {
      list.unread.push_back(unread_object(name, kind));
    } else if (nested) {
      require_all_of(file, object, depth + 1, list);
    } else if (!is_read(list, name) && !file.has_attribute(object, "MATLAB_empty") &&
               !(depth > 0 && is_read(list, group.substr(1) + "/0/" + child))) {
      throw FormatError(list.file, name,
                        "its data cannot be read; the file is damaged. Save it again in MATLAB, "
                        "for example with -v7");
    }
  }
}

}  // namespace

UnreadVariable unread_object(const std::string& name, const std::string& object_class) {
  return {
      name, fmt::format("MATLAB object{}", object_class.empty() ? "" : " (" + object_class + ")"),
      fmt::format("Save its contents as arrays in MATLAB, for example x = {0}.COLUMN of a table, "
                  "or struct({0})",
                  name.empty() ? "T" : name)};
}

std::vector<UnreadVariable> objects_of_v5(const std::filesystem::path& path) {
  const std::string content = read_whole_file(path);
  std::vector<UnreadVariable> objects;
  if (!content.starts_with("MATLAB 5.0") || content.size() < kHeadBytes) return objects;
  const bool big_endian = content[126] == 'M';
  std::size_t at = kHeadBytes;
  while (at + 8 <= content.size()) {
    const std::uint32_t type = word_at(content, at, big_endian);
    const std::size_t size = word_at(content, at + 4, big_endian);
    const std::string_view element =
        std::string_view(content).substr(at, 8 + std::min(size, content.size() - at - 8));
    const auto object = type == kCompressed
                            ? object_of(inflated_begin(element.substr(8)), big_endian)
                            : object_of(element, big_endian);
    if (object) objects.push_back(*object);
    at += element.size();
  }
  return objects;
}

void require_all_of_v73(ArrayList& list) {
  require_all_of(Hdf5File::open(list.file), "/", 0, list);
}

}  // namespace stageid
