#include "tools/config/config_reader.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "acquisition/files/key_suggestion.hpp"
#include "tools/config/number_range.hpp"
#include "tools/terminal/format_errors.hpp"

namespace stageid {
namespace {

std::string quoted(const YamlNode& node) {
  switch (node.kind) {
    case YamlNode::Kind::null:
      return "nothing";
    case YamlNode::Kind::sequence:
      return "a list";
    case YamlNode::Kind::map:
      return "a map";
    case YamlNode::Kind::scalar:
      break;
  }
  constexpr std::size_t kLongest = 40;
  if (node.text.size() <= kLongest) return fmt::format("'{}'", node.text);
  // Cut between characters, not inside a UTF-8 sequence.
  std::size_t end = kLongest;
  while (end > 0 && (static_cast<unsigned char>(node.text[end]) & 0xC0U) == 0x80U) --end;
  return fmt::format("'{}...'", node.text.substr(0, end));
}

/// Reads the keys of one map.
class MapReader final : public ConfigVisitor {
 public:
  MapReader(const YamlDocument& document, const YamlNode& map, std::string place,
            FormatErrorList& errors)
      : document_(document),
        map_(map),
        place_(std::move(place)),
        errors_(errors),
        errors_before_(errors.size()) {
    if (map.kind != YamlNode::Kind::map)
      document.fail(map.mark, fmt::format("{} is {}; write a map, 'key: value' lines",
                                          place_.empty() ? "the file" : place_, quoted(map)));
  }

  /// Keys without a description are unknown. Missing keys are reported only if there are no unknown ones, which may be
  /// misspelt. Rules between values are checked only if the values are valid.
  void finish() const {
    bool unknown = false;
    for (const YamlNode::Entry& entry : map_.entries) {
      if (std::ranges::find(known_, entry.key) != known_.end()) continue;
      unknown = true;
      errors_.attempt([&] {
        document_.fail(entry.mark, fmt::format("unknown key '{}'; {}", entry.key,
                                               suggest_key(entry.key, known_)));
      });
    }
    for (const Missing& missing : missing_)
      if (!unknown)
        errors_.attempt([&] {
          document_.fail(map_.mark,
                         fmt::format("key '{}' is missing{}; add it ({})", missing.key,
                                     place_.empty() ? "" : " in " + place_, missing.help));
        });
    if (errors_.size() > errors_before_) return;
    for (const Broken& broken : broken_)
      errors_.attempt([&] { document_.fail(broken.mark, broken.message); });
  }

  void number(const char* key, double& value, const NumberRule& rule, Presence presence,
              const char* help) override {
    read(key, presence, help, [&](const YamlNode& node) { value = parse_number(key, node, rule); });
  }
  void numbers(const char* key, std::vector<double>& values, const NumberRule& rule,
               CountRule count, Presence presence, const char* help) override {
    read_list(key, values, count, presence, help,
              [&](const YamlNode& item) { values.push_back(parse_number(key, item, rule)); });
  }
  void integer(const char* key, std::int64_t& value, std::int64_t low, std::int64_t high,
               Presence presence, const char* help) override {
    read(key, presence, help, [&](const YamlNode& node) {
      const char* end = node.text.data() + node.text.size();
      std::int64_t parsed = 0;
      const auto [stop, error] = std::from_chars(node.text.data(), end, parsed);
      if (node.kind != YamlNode::Kind::scalar || !node.plain || stop != end || error != std::errc{})
        wrong(key, node, "a whole number");
      if (parsed < low || parsed > high)
        document_.fail(node.mark, fmt::format("{}: {} is out of range; expected {}", key, parsed,
                                              describe_range(low, high)));
      value = parsed;
    });
  }
  void text(const char* key, std::string& value, Presence presence, const char* help) override {
    read(key, presence, help, [&](const YamlNode& node) { value = parse_text(key, node); });
  }
  void texts(const char* key, std::vector<std::string>& values, CountRule count, Presence presence,
             const char* help) override {
    read_list(key, values, count, presence, help, [&](const YamlNode& item) {
      values.push_back(parse_text(key, item));
      if (std::ranges::count(values, values.back()) > 1)
        document_.fail(item.mark,
                       fmt::format("{}: duplicate entry '{}'; keep one", key, values.back()));
    });
  }
  void choice(const char* key, std::size_t& index, const std::vector<std::string>& names,
              Presence presence, const char* help) override {
    read(key, presence, help, [&](const YamlNode& node) {
      const auto found = std::ranges::find(names, node.text);
      if (node.kind != YamlNode::Kind::scalar || found == names.end()) wrong_word(key, node, names);
      index = static_cast<std::size_t>(found - names.begin());
    });
  }
  void flexible(const char* key, FlexibleValue& value, const FlexibleRule& rule, Presence presence,
                const char* help) override {
    read(key, presence, help, [&](const YamlNode& node) {
      FlexibleValue given;  // keeps the default if invalid, so that later checks can continue
      const std::size_t errors = errors_.size();
      if (node.kind == YamlNode::Kind::sequence && (rule.list || rule.pairs)) {
        given.is_list = true;
        for (const std::size_t item : list(key, node, {1}))
          errors_.attempt([&] { read_item(key, document_.node(item), rule, given); });
      } else if (node.kind == YamlNode::Kind::scalar && is_word(node, rule)) {
        given.word = node.text;
      } else if (node.kind == YamlNode::Kind::scalar && rule.number && looks_numeric(node)) {
        given.numbers = {parse_number(key, node, rule.rule)};
      } else if (node.kind == YamlNode::Kind::scalar && rule.any_text && !node.text.empty()) {
        given.word = node.text;
      } else {
        wrong(key, node, describe_forms(rule) + nearest_of(node, rule.words));
      }
      if (errors_.size() == errors) value = std::move(given);
    });
  }
  void named_numbers(const char* key, std::vector<std::pair<std::string, double>>& values,
                     const NumberRule& rule, Presence presence, const char* help) override {
    read_names(
        key, values, "a map {name: number, ...}", presence, help,
        [&](const char* name, const YamlNode& value) { return parse_number(name, value, rule); });
  }
  void named_texts(const char* key, std::vector<std::pair<std::string, std::string>>& values,
                   Presence presence, const char* help) override {
    read_names(key, values, "a map {name: text, ...}", presence, help,
               [&](const char* name, const YamlNode& value) {
                 if (value.kind != YamlNode::Kind::scalar) wrong(name, value, "a text");
                 return value.text;
               });
  }
  void group(const char* key, const Describe& describe, Presence presence,
             const char* help) override {
    read(key, presence, help, [&](const YamlNode& node) { read_map(key, node, describe); });
  }
  void group_or_text(const char* key, const Describe& describe, std::string& text,
                     Presence presence, const char* help) override {
    read(key, presence, help, [&](const YamlNode& node) {
      if (node.kind == YamlNode::Kind::scalar && !node.text.empty())
        text = node.text;
      else
        read_map(key, node, describe);
    });
  }
  void items(const char* key, const Describe& describe_item, CountRule count, Presence presence,
             const char* help) override {
    read(key, presence, help, [&](const YamlNode& node) {
      std::size_t index = 0;
      for (const std::size_t item : list(key, node, count))
        read_map(fmt::format("{} {}", key, ++index), document_.node(item), describe_item);
    });
  }
  void require(bool holds, const char* key, const std::string& message) override {
    if (holds) return;
    const YamlNode* value = document_.value(map_, key);
    broken_.push_back({value == nullptr ? map_.mark : value->mark, message});
  }

 private:
  /// Calls `take` with the value of a key, if the map has it; collects the errors.
  template <typename Take>
  void read(const char* key, Presence presence, const char* help, Take take) {
    known_.emplace_back(key);
    const YamlNode* value = document_.value(map_, key);
    if (value != nullptr && known_.back() == "format")
      take(*value);  // a file of another kind has other keys
    else if (value != nullptr)
      errors_.attempt([&] { take(*value); });
    else if (presence == Presence::required)
      missing_.push_back({key, help});
  }
  template <typename Values, typename Take>
  void read_list(const char* key, Values& values, CountRule count, Presence presence,
                 const char* help, Take take) {
    read(key, presence, help, [&](const YamlNode& node) {
      values.clear();
      for (const std::size_t item : list(key, node, count))
        errors_.attempt([&] { take(document_.node(item)); });
    });
  }
  template <typename Values, typename Parse>
  void read_names(const char* key, Values& values, const char* right, Presence presence,
                  const char* help, Parse parse) {
    read(key, presence, help, [&](const YamlNode& node) {
      if (node.kind != YamlNode::Kind::map) wrong(key, node, right);
      values.clear();
      for (const YamlNode::Entry& entry : node.entries)
        errors_.attempt([&] {
          values.emplace_back(entry.key, parse(entry.key.c_str(), document_.node(entry.value)));
        });
    });
  }
  void read_map(const std::string& name, const YamlNode& node, const Describe& describe) {
    errors_.attempt([&] {
      MapReader reader(document_, node, name, errors_);
      describe(reader);
      reader.finish();
    });
  }
  const std::vector<std::size_t>& list(const char* key, const YamlNode& node,
                                       CountRule count) const {
    if (node.kind != YamlNode::Kind::sequence) wrong(key, node, "a list [..., ...]");
    if (node.items.size() < count.least || node.items.size() > count.most)
      document_.fail(node.mark, fmt::format("{}: got {} entries; expected {}", key,
                                            node.items.size(), describe_count(count)));
    return node.items;
  }
  double parse_number(const char* key, const YamlNode& node, const NumberRule& rule) const {
    const std::optional<double> value = to_number(node);
    if (!value) {
      const std::string hint = unit_hint(node, rule);
      wrong(key, node, hint.empty() ? fmt::format("a number{}", in_unit(rule)) : hint);
    }
    if (!std::isfinite(*value))
      document_.fail(node.mark, fmt::format("{}: {} is not finite; write a number{}", key,
                                            node.text, in_unit(rule)));
    if (!in_range(*value, rule))
      document_.fail(node.mark, fmt::format("{}: {} is out of range; expected {}", key, node.text,
                                            describe_range(rule)));
    return *value;
  }
  static std::optional<double> to_number(const YamlNode& node) {
    if (node.kind != YamlNode::Kind::scalar || !node.plain || node.text.empty())
      return std::nullopt;
    std::string_view text = node.text;
    const bool negative = text.front() == '-';
    if (negative || text.front() == '+') text.remove_prefix(1);
    for (const char* word : {".inf", ".Inf", ".INF"})
      if (text == word) return std::numeric_limits<double>::infinity();
    for (const char* word : {".nan", ".NaN", ".NAN"})
      if (text == word) return std::numeric_limits<double>::quiet_NaN();
    double value = 0.0;
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (stop != text.data() + text.size() || text.front() == '-') return std::nullopt;
    if (error == std::errc::result_out_of_range) return std::numeric_limits<double>::infinity();
    if (error != std::errc{}) return std::nullopt;
    return negative ? -value : value;
  }
  static std::string in_unit(const NumberRule& rule) {
    return rule.unit.empty() ? "" : fmt::format(" in {}", rule.unit);
  }
  /// Remedy for values such as "4 s".
  static std::string unit_hint(const YamlNode& node, const NumberRule& rule) {
    if (node.kind != YamlNode::Kind::scalar || rule.unit.empty()) return "";
    if (!node.plain) return fmt::format("a number in {}, without quotes", rule.unit);
    const bool digit_first =
        !node.text.empty() && node.text.front() >= '0' && node.text.front() <= '9';
    if (!digit_first) return "";
    return fmt::format("the number alone, in {} (the unit is part of the key)", rule.unit);
  }
  std::string parse_text(const char* key, const YamlNode& node) const {
    if (node.kind != YamlNode::Kind::scalar || node.text.empty()) wrong(key, node, "a text");
    return node.text;
  }
  static bool looks_numeric(const YamlNode& node) {
    return node.plain && !node.text.empty() &&
           (to_number(node).has_value() || std::isdigit(static_cast<unsigned char>(node.text[0])));
  }
  static bool is_word(const YamlNode& node, const FlexibleRule& rule) {
    return std::ranges::find(rule.words, node.text) != rule.words.end();
  }
  void read_item(const char* key, const YamlNode& item, const FlexibleRule& rule,
                 FlexibleValue& value) const {
    if (!rule.pairs) {
      value.numbers.push_back(parse_number(key, item, rule.rule));
      return;
    }
    const std::vector<std::size_t>& pair = list(key, item, {2, 2});
    value.pairs.emplace_back(parse_number(key, document_.node(pair[0]), rule.rule),
                             parse_number(key, document_.node(pair[1]), rule.rule));
  }
  [[noreturn]] void wrong(const char* key, const YamlNode& node, const std::string& right) const {
    document_.fail(node.mark, fmt::format("{}: got {}; expected {}", key, quoted(node), right));
  }
  [[noreturn]] void wrong_word(const char* key, const YamlNode& node,
                               const std::vector<std::string>& names) const {
    wrong(key, node,
          fmt::format("{}{}{}", names.size() > 1 ? "one of " : "", fmt::join(names, ", "),
                      nearest_of(node, names)));
  }
  static std::string nearest_of(const YamlNode& node, const std::vector<std::string>& words) {
    return node.kind == YamlNode::Kind::scalar ? nearest_hint(node.text, words) : "";
  }

  struct Missing {
    std::string key;
    std::string help;
  };
  struct Broken {
    YamlMark mark;
    std::string message;
  };

  const YamlDocument& document_;
  const YamlNode& map_;
  std::string place_;
  std::vector<std::string> known_;
  std::vector<Missing> missing_;
  std::vector<Broken> broken_;
  FormatErrorList& errors_;
  std::size_t errors_before_ = 0;
};

}  // namespace

void read_config(const YamlDocument& document, const ConfigVisitor::Describe& describe) {
  FormatErrorList errors;
  errors.attempt([&] {
    MapReader reader(document, document.root(), "", errors);
    describe(reader);
    reader.finish();
  });
  errors.raise();
}

}  // namespace stageid
