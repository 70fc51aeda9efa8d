#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace stageid {

/// A position in a text file, 1-based.
struct YamlMark {
  int line = 1;
  int column = 1;
};

/// One value of a document. Children are indices into the document, so that repeated anchors cost nothing and hostile
/// nesting cannot overflow the stack.
struct YamlNode {
  enum class Kind : unsigned char { null, scalar, sequence, map };
  struct Entry {
    std::string key;
    YamlMark mark;
    std::size_t value = 0;
  };
  Kind kind = Kind::null;
  YamlMark mark;
  std::string text;   ///< scalar: as written, without quotes
  bool plain = true;  ///< scalar: not in quotes
  std::vector<std::size_t> items;
  std::vector<Entry> entries;
};

/// A YAML file as a tree with positions. Stricter than YAML: one document, UTF-8, text keys, no duplicate keys, no
/// tags, at most 20 levels deep and 1 MiB long. Anchors, aliases and merge keys ("<<") are supported.
class YamlDocument {
 public:
  /// @throws FileError if the file cannot be read. @throws FormatError "FILE:LINE:COLUMN: ...".
  static YamlDocument read(const std::filesystem::path& file);
  /// `file` is used in errors only. @throws FormatError
  static YamlDocument parse(std::filesystem::path file, std::string text);

  const std::filesystem::path& file() const noexcept { return file_; }
  const std::string& text() const noexcept { return text_; }
  const YamlNode& root() const { return nodes_.at(root_); }
  const YamlNode& node(std::size_t index) const { return nodes_.at(index); }
  /// The value of a key; null if the map lacks it.
  const YamlNode* value(const YamlNode& map, std::string_view key) const;
  /// @throws FormatError "FILE:LINE:COLUMN: message", always.
  [[noreturn]] void fail(const YamlMark& mark, const std::string& message) const;

 private:
  YamlDocument(std::filesystem::path file, std::string text);
  friend class YamlTreeBuilder;

  std::filesystem::path file_;
  std::string text_;
  std::vector<YamlNode> nodes_;
  std::size_t root_ = 0;
};

}  // namespace stageid
