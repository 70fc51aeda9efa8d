#include "tools/terminal/text_template.hpp"

#include <algorithm>

namespace stageid {

std::string fill_template(
    std::string_view text,
    const std::vector<std::pair<std::string_view, std::string_view>>& values) {
  std::string out;
  while (true) {
    const std::size_t begin = text.find('@');
    out += text.substr(0, begin);
    if (begin == std::string_view::npos) return out;
    text.remove_prefix(begin + 1);
    const std::string_view name = text.substr(0, text.find('@'));
    const auto value = std::ranges::find(values, name, [](const auto& v) { return v.first; });
    out += value == values.end() ? "@" : value->second;
    if (value != values.end()) text.remove_prefix(name.size() + 1);
  }
}

}  // namespace stageid
