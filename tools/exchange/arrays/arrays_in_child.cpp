#include <complex>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "acquisition/files/child_process.hpp"
#include "tools/exchange/arrays/named_array.hpp"

namespace stageid {
namespace {

// Both ends are this program: values as they are in memory, lists with their length first.

struct Sender {
  std::string bytes;

  void pass(const void* from, std::size_t size) {
    if (size > 0) bytes.append(static_cast<const char*>(from), size);
  }
};

struct Receiver {
  std::string_view bytes;

  void pass(void* to, std::size_t size) {
    if (size > 0) std::memcpy(to, bytes.substr(0, size).data(), size);
    bytes.remove_prefix(size);
  }
};

template <typename End>
void pass(End& end, UnreadVariable& variable) {
  for (std::string* text : {&variable.name, &variable.what, &variable.remedy}) pass(end, *text);
}

template <typename End>
void pass(End& end, NamedArray& array) {
  pass(end, array.name);
  pass(end, array.shape);
  std::size_t kind = array.values.index();
  end.pass(&kind, sizeof(kind));
  if (kind == 1 && !array.is_complex()) array.values = std::vector<std::complex<double>>();
  if (kind == 2 && !array.is_text()) array.values = std::vector<std::string>();
  std::visit([&end](auto& values) { pass(end, values); }, array.values);
  if constexpr (std::is_same_v<End, Sender>) array = {};  // frees its memory
}

/// Texts and vectors.
template <typename End, typename List>
void pass(End& end, List& list) {
  using Item = typename List::value_type;
  std::size_t count = list.size();
  end.pass(&count, sizeof(count));
  list.resize(count);
  if constexpr (std::is_trivially_copyable_v<Item>)
    end.pass(list.data(), count * sizeof(Item));
  else
    for (Item& item : list) pass(end, item);
}

}  // namespace

ArrayList arrays_in_child(const std::filesystem::path& file,
                          const std::function<ArrayList(const std::filesystem::path&)>& read) {
  const std::string answer = in_child(file, [&] {
    ArrayList list = read(file);
    Sender sender;
    pass(sender, list.unread);
    pass(sender, list.arrays);
    return std::move(sender.bytes);
  });
  Receiver receiver{answer};
  ArrayList list{file, {}};
  pass(receiver, list.unread);
  pass(receiver, list.arrays);
  return list;
}

}  // namespace stageid
