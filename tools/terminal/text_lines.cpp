#include "tools/terminal/text_lines.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "acquisition/files/input_files.hpp"

namespace stageid {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";  // of UTF-8 files from Windows

}  // namespace

TextLines::TextLines(const std::filesystem::path& file)
    : file_(file), text_(read_whole_file(file)) {
  if (text_.starts_with(kByteOrderMark)) at_ = kByteOrderMark.size();
}

std::string_view TextLines::next() {
  if (at_end()) {
    ++line_;
    fail("unexpected end of file; the file is truncated");
  }
  ++line_;
  const std::size_t end = std::min(text_.find('\n', at_), text_.size());
  std::string_view line = std::string_view(text_).substr(at_, end - at_);
  at_ = std::min(end + 1, text_.size());  // the last line may have no line end
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

std::optional<double> parse_number(std::string_view text) {
  std::string digits(trimmed(text));
  std::replace_if(
      digits.begin(), digits.end(), [](char c) { return c == 'D' || c == 'd'; }, 'e');
  const char* first = digits.data() + (digits.starts_with('+') ? 1 : 0);
  const char* last = digits.data() + digits.size();
  double value = 0.0;
  const auto [stop, error] = std::from_chars(first, last, value);
  if (stop != last || error != std::errc{} || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace stageid
