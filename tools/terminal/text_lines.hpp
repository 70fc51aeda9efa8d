#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "acquisition/files/fail.hpp"

namespace stageid {

/// A whole file in memory, read line by line; lines end with LF or CR LF.
class TextLines {
 public:
  /// @throws FileError
  explicit TextLines(const std::filesystem::path& file);

  const std::filesystem::path& file() const noexcept { return file_; }
  bool at_end() const noexcept { return at_ >= text_.size(); }
  std::size_t line_number() const noexcept { return line_; }  ///< of the line read last, 1-based
  /// The next line without its end; @throws FormatError at the end of the file.
  std::string_view next();
  std::string_view rest() const noexcept { return std::string_view(text_).substr(at_); }
  void skip(std::size_t bytes) noexcept { at_ += bytes; }  ///< of rest()
  /// @throws FormatError "FILE:LINE: message", always.
  template <typename... Parts>
  [[noreturn]] void fail(fmt::format_string<Parts...> what, Parts&&... parts) const {
    fail_format(file_, std::to_string(line_), what, std::forward<Parts>(parts)...);
  }

 private:
  std::filesystem::path file_;
  std::string text_;
  std::size_t at_ = 0;
  std::size_t line_ = 0;
};

/// Without leading and trailing blanks.
std::string_view trimmed(std::string_view text);

/// A finite number in any Fortran or C notation: 1e-3, 1.D+00, -.5, +2.
std::optional<double> parse_number(std::string_view text);

}  // namespace stageid
