#pragma once

#include <fstream>
#include <string>
#include <string_view>
#include <vector>

namespace stageid::test {

inline std::vector<std::string> split(std::string_view text, std::string_view separator) {
  std::vector<std::string> parts;
  for (std::size_t end = 0; end != std::string_view::npos;) {
    end = text.find(separator);
    parts.emplace_back(text.substr(0, end));
    if (end != std::string_view::npos) text.remove_prefix(end + separator.size());
  }
  return parts;
}

/// The cells of the table in a page of docs whose head begins like this.
inline std::vector<std::vector<std::string>> table_in_docs(const std::string& page,
                                                           const std::string& head) {
  std::ifstream in(STAGEID_SOURCE_DIR "/docs/" + page);
  std::vector<std::vector<std::string>> rows;
  std::string line;
  while (std::getline(in, line) && !line.starts_with(head)) {
  }
  std::getline(in, line);  // the rule below the head
  while (std::getline(in, line) && line.starts_with("| "))
    rows.push_back(split(std::string_view(line).substr(2, line.size() - 4), " | "));
  return rows;
}

}  // namespace stageid::test
