#include "tools/exchange/arrays/arrays_in_child.hpp"

#include <complex>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "acquisition/files/child_process.hpp"

namespace stageid {
namespace {

// Both ends are this program: values as they are in memory, lists with their length first.

void put(std::string& out, std::uint64_t number) {
  out.append(reinterpret_cast<const char*>(&number), sizeof(number));
}
void put(std::string& out, const std::string& text) {
  put(out, text.size());
  out += text;
}
template <typename Value>
void put(std::string& out, const std::vector<Value>& values) {
  put(out, values.size());
  if constexpr (std::is_same_v<Value, std::string>)
    for (const std::string& text : values) put(out, text);
  else if (!values.empty())
    out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(Value));
}

std::string bytes_of(ArrayList list) {
  std::string out;
  put(out, list.unread.size());
  for (const UnreadVariable& variable : list.unread)
    for (const std::string* text : {&variable.name, &variable.what, &variable.remedy})
      put(out, *text);
  put(out, list.arrays.size());
  for (NamedArray& array : list.arrays) {
    put(out, array.name);
    put(out, array.shape);
    put(out, array.values.index());
    std::visit([&out](const auto& values) { put(out, values); }, array.values);
    array = {};  // frees its memory
  }
  return out;
}

class Bytes {
 public:
  explicit Bytes(std::string_view bytes) : bytes_(bytes) {}

  void take(std::uint64_t& number) { copy(&number, sizeof(number)); }
  void take(std::string& text) {
    text.resize(count());
    copy(text.data(), text.size());
  }
  template <typename Value>
  void take(std::vector<Value>& values) {
    values.resize(count());
    if constexpr (std::is_same_v<Value, std::string>)
      for (std::string& text : values) take(text);
    else
      copy(values.data(), values.size() * sizeof(Value));
  }
  std::uint64_t count() {
    std::uint64_t number = 0;
    take(number);
    return number;
  }

 private:
  void copy(void* to, std::size_t size) {
    if (size > 0) std::memcpy(to, bytes_.substr(0, size).data(), size);
    bytes_.remove_prefix(size);
  }
  std::string_view bytes_;
};

template <typename Value>
std::vector<Value> values_of(Bytes& bytes) {
  std::vector<Value> values;
  bytes.take(values);
  return values;
}

}  // namespace

ArrayList arrays_in_child(const std::filesystem::path& file,
                          const std::function<ArrayList(const std::filesystem::path&)>& read) {
  const std::string answer = in_child(file, [&] { return bytes_of(read(file)); });
  Bytes bytes(answer);
  ArrayList list{file, {}};
  list.unread.resize(bytes.count());
  for (UnreadVariable& variable : list.unread)
    for (std::string* text : {&variable.name, &variable.what, &variable.remedy}) bytes.take(*text);
  list.arrays.resize(bytes.count());
  for (NamedArray& array : list.arrays) {
    bytes.take(array.name);
    bytes.take(array.shape);
    switch (bytes.count()) {
      case 0:
        array.values = values_of<double>(bytes);
        break;
      case 1:
        array.values = values_of<std::complex<double>>(bytes);
        break;
      default:
        array.values = values_of<std::string>(bytes);
    }
  }
  return list;
}

}  // namespace stageid
