#include "tools/config/yaml_document.hpp"

#include <fmt/format.h>
#include <utf8.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <fstream>
#include <map>
#include <sstream>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_kind.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {
namespace {

constexpr std::size_t kLongestFile = 1U << 20;
constexpr std::size_t kDeepestNesting = 20;
/// Limits the time for duplicate keys and merging; real configurations have less than a tenth of this.
constexpr std::size_t kMostKeys = 1000;
constexpr std::size_t kMostMerged = 100000;

std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

}  // namespace

/// Builds nodes from the events of yaml-cpp, whose own tree has no positions of keys and accepts duplicates.
class YamlTreeBuilder final : public YAML::EventHandler {
 public:
  explicit YamlTreeBuilder(YamlDocument& document) : document_(document) {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    document_.nodes_[add(YamlNode::Kind::null, mark, anchor)].mark = place_of_null(mark);
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = anchors_.find(anchor);
    if (found == anchors_.end() ||
        std::ranges::any_of(open_, [&](const Open& open) { return open.node == found->second; }))
      document_.fail(place(mark), "this alias refers to itself; use an anchor defined above it");
    attach(found->second);
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    refuse_tag(mark, tag);
    if (!open_.empty() && is_map(open_.back()) && !open_.back().has_key) {
      take_key(mark, value);
      return;
    }
    YamlNode& node = document_.nodes_[add(YamlNode::Kind::scalar, mark, anchor)];
    node.text = value;
    node.plain = tag != "!";
    if (node.plain && (value == "~" || value == "null")) node.kind = YamlNode::Kind::null;
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    refuse_tag(mark, tag);
    open(YamlNode::Kind::sequence, mark, anchor);
  }
  void OnSequenceEnd() override { open_.pop_back(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    refuse_tag(mark, tag);
    open(YamlNode::Kind::map, mark, anchor);
  }
  void OnMapEnd() override {
    merge(open_.back().node);
    open_.pop_back();
  }

 private:
  struct Open {
    std::size_t node = 0;
    bool has_key = false;
  };

  static YamlMark place(const YAML::Mark& mark) { return {mark.line + 1, mark.column + 1}; }
  bool is_map(const Open& open) const {
    return document_.nodes_[open.node].kind == YamlNode::Kind::map;
  }
  /// yaml-cpp reports a missing value at the next token, possibly lines further down; the user has to write it after
  /// the key.
  YamlMark place_of_null(const YAML::Mark& mark) const {
    const YamlMark here = place(mark);
    if (open_.empty() || !is_map(open_.back()) || !open_.back().has_key) return here;
    const YamlNode::Entry& last = document_.nodes_[open_.back().node].entries.back();
    if (last.mark.line == here.line) return here;
    return {last.mark.line, last.mark.column + static_cast<int>(last.key.size()) + 1};
  }
  void refuse_tag(const YAML::Mark& mark, const std::string& tag) const {
    if (tag != "" && tag != "!" && tag != "?")
      document_.fail(place(mark), fmt::format("unsupported tag '{}'; remove it", tag));
  }

  std::size_t add(YamlNode::Kind kind, const YAML::Mark& mark, YAML::anchor_t anchor) {
    const std::size_t index = document_.nodes_.size();
    YamlNode node;
    node.kind = kind;
    node.mark = place(mark);
    if (!open_.empty() && is_map(open_.back()) && !open_.back().has_key)
      document_.fail(node.mark, "a key must be a word; write 'key: value'");
    document_.nodes_.push_back(std::move(node));
    if (anchor != YAML::NullAnchor) anchors_[anchor] = index;
    attach(index);
    return index;
  }
  void open(YamlNode::Kind kind, const YAML::Mark& mark, YAML::anchor_t anchor) {
    if (open_.size() >= kDeepestNesting)
      document_.fail(
          place(mark),
          fmt::format("nested deeper than {} levels; configurations need fewer", kDeepestNesting));
    open_.push_back({add(kind, mark, anchor), false});
  }
  /// @param keys number of keys of a map
  void refuse_too_many(const YamlMark& mark, std::size_t keys) const {
    if (keys > kMostKeys)
      document_.fail(
          mark, fmt::format("more than {} keys in one map; split it or remove keys", kMostKeys));
  }
  void take_key(const YAML::Mark& mark, const std::string& key) {
    for (const YamlNode::Entry& entry : document_.nodes_[open_.back().node].entries)
      if (entry.key == key)
        document_.fail(place(mark), fmt::format("duplicate key '{}', first in line {}; keep one",
                                                key, entry.mark.line));
    std::vector<YamlNode::Entry>& entries = document_.nodes_[open_.back().node].entries;
    entries.push_back({key, place(mark), 0});
    refuse_too_many(place(mark), entries.size());
    open_.back().has_key = true;
  }
  void attach(std::size_t index) {
    if (open_.empty()) {
      document_.root_ = index;
      return;
    }
    YamlNode& parent = document_.nodes_[open_.back().node];
    if (parent.kind == YamlNode::Kind::sequence) {
      parent.items.push_back(index);
      return;
    }
    if (!open_.back().has_key)
      document_.fail(parent.mark, "an alias cannot be a key; write 'key: *alias'");
    parent.entries.back().value = index;
    open_.back().has_key = false;
  }
  void merge(std::size_t map) {
    std::vector<YamlNode::Entry>& entries = document_.nodes_[map].entries;
    const auto found = std::ranges::find_if(
        entries, [](const YamlNode::Entry& entry) { return entry.key == "<<"; });
    if (found == entries.end()) return;
    const YamlNode& base = document_.nodes_[found->value];
    if (base.kind != YamlNode::Kind::map)
      document_.fail(found->mark, "'<<' needs a map; write '<<: *anchor_of_a_map'");
    const std::vector<YamlNode::Entry> inherited = base.entries;
    const YamlMark mark = found->mark;
    merged_ += inherited.size();
    if (merged_ > kMostMerged)
      document_.fail(
          mark,
          fmt::format("'<<' copied more than {} keys in this file; write only the keys that differ",
                      kMostMerged));
    entries.erase(found);
    for (const YamlNode::Entry& entry : inherited)
      if (std::ranges::none_of(entries,
                               [&](const YamlNode::Entry& own) { return own.key == entry.key; }))
        entries.push_back(entry);
    refuse_too_many(mark, entries.size());
  }

  YamlDocument& document_;
  std::size_t merged_ = 0;
  std::vector<Open> open_;
  std::map<YAML::anchor_t, std::size_t> anchors_;
};

namespace {

void check_text(const YamlDocument& document) {
  YamlMark mark;
  std::string_view rest = document.text();
  if (utf8::starts_with_bom(rest)) rest.remove_prefix(3);
  const auto end = utf8::find_invalid(rest.begin(), rest.end());
  for (auto at = rest.begin(); at != end;) {
    const std::uint32_t point = utf8::unchecked::next(at);
    const bool control =
        (point < 0x20 && point != '\n' && point != '\t' && point != '\r') || point == 0x7F;
    if (control)
      document.fail(
          mark, fmt::format("byte 0x{:02X} is not text; save the configuration as a YAML text file",
                            point));
    if (point == '\n') {
      mark = {mark.line + 1, 1};
    } else {
      ++mark.column;
    }
  }
  if (end != rest.end())
    document.fail(mark, fmt::format("byte 0x{:02X} is not UTF-8 text; save the file as UTF-8",
                                    static_cast<unsigned char>(*end)));
}

}  // namespace

const YamlNode* YamlDocument::value(const YamlNode& map, std::string_view key) const {
  const auto found = std::ranges::find(map.entries, key, &YamlNode::Entry::key);
  return found == map.entries.end() ? nullptr : &node(found->value);
}

YamlDocument::YamlDocument(std::filesystem::path file, std::string text)
    : file_(std::move(file)), text_(std::move(text)) {}

void YamlDocument::fail(const YamlMark& mark, const std::string& message) const {
  throw FormatError(file_, fmt::format("{}:{}", mark.line, mark.column), one_line(message));
}

YamlDocument YamlDocument::read(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file)) fail_file(file, "is a directory; use a YAML file");
  note_input(file);
  std::ifstream stream(file, std::ios::binary);
  if (!stream) fail_file(file, "cannot be read: {}", system_reason(errno));
  std::string text(kLongestFile + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(stream.gcount());
  if (stream.bad()) fail_file(file, "cannot be read; check the disk");
  const bool json = text.starts_with('{') && file.extension() != ".json";  // JSON is YAML
  if (json || text.find('\0') != std::string::npos)
    if (const std::string other = other_kind(file, "a YAML file"); !other.empty())
      throw FormatError(file, "", other);
  return parse(file, std::move(text));
}

YamlDocument YamlDocument::parse(std::filesystem::path file, std::string text) {
  YamlDocument document(std::move(file), std::move(text));
  if (document.text_.size() > kLongestFile)
    document.fail({}, "longer than 1 MiB, too long for a configuration; check the file");
  check_text(document);
  YamlTreeBuilder builder(document);
  // Converts the exceptions of yaml-cpp.
  try {
    std::istringstream stream(document.text_);
    YAML::Parser parser(stream);
    if (!parser.HandleNextDocument(builder) || document.nodes_.empty())
      document.fail({}, "the file is empty; 'stageid config schema' prints all keys");
    const std::size_t first_nodes = document.nodes_.size();
    const std::size_t root = document.root_;
    YamlTreeBuilder second(document);
    if (parser.HandleNextDocument(second) && document.nodes_.size() > first_nodes)
      document.fail(document.nodes_[first_nodes].mark, "a second YAML document; keep one per file");
    document.root_ = root;
  } catch (const YAML::Exception& error) {
    const YamlMark mark =
        error.mark.is_null() ? YamlMark{} : YamlMark{error.mark.line + 1, error.mark.column + 1};
    document.fail(mark, error.msg.starts_with(YAML::ErrorMsg::UNKNOWN_ANCHOR)
                            ? "undefined anchor; define it with '&' above its first use"
                            : "not YAML; check brackets, quotes, colons and indentation (spaces, "
                              "no tabs) up to here");
  }
  return document;
}

}  // namespace stageid
