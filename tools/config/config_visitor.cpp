#include "tools/config/config_visitor.hpp"

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

std::optional<double> to_number(const YamlNode& node) {
  if (node.kind != YamlNode::Kind::scalar || !node.plain || node.text.empty()) return std::nullopt;
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

bool looks_numeric(const YamlNode& node) {
  return node.plain && !node.text.empty() &&
         (to_number(node).has_value() || std::isdigit(static_cast<unsigned char>(node.text[0])));
}

std::string in_unit(const NumberRule& rule) {
  return rule.unit.empty() ? "" : fmt::format(" in {}", rule.unit);
}

/// Remedy for values such as "4 s".
std::string unit_hint(const YamlNode& node, const NumberRule& rule) {
  if (node.kind != YamlNode::Kind::scalar || rule.unit.empty()) return "";
  if (!node.plain) return fmt::format("a number in {}, without quotes", rule.unit);
  const bool digit_first =
      !node.text.empty() && node.text.front() >= '0' && node.text.front() <= '9';
  if (!digit_first) return "";
  return fmt::format("the number alone, in {} (the unit is part of the key)", rule.unit);
}

std::string nearest_of(const YamlNode& node, const std::vector<std::string>& words) {
  return node.kind == YamlNode::Kind::scalar ? nearest_hint(node.text, words) : "";
}

}  // namespace

struct ConfigValue {
  const YamlDocument& document;
  FormatErrorList& errors;
  const char* key;
  const YamlNode& node;

  ConfigValue of(const char* name, std::size_t index) const {
    return {document, errors, name, document.node(index)};
  }
  template <typename... Parts>
  [[noreturn]] void fail(fmt::format_string<Parts...> what, Parts&&... parts) const {
    document.fail(node.mark,
                  fmt::format("{}: {}", key, fmt::format(what, std::forward<Parts>(parts)...)));
  }
  [[noreturn]] void wrong(const std::string& right) const {
    fail("got {}; expected {}", quoted(node), right);
  }
  bool is_scalar() const { return node.kind == YamlNode::Kind::scalar; }
  bool is_one_of(const std::vector<std::string>& words) const {
    return is_scalar() && std::ranges::find(words, node.text) != words.end();
  }

  double number(const NumberRule& rule) const {
    const std::optional<double> value = to_number(node);
    if (!value) {
      const std::string hint = unit_hint(node, rule);
      wrong(hint.empty() ? fmt::format("a number{}", in_unit(rule)) : hint);
    }
    if (!std::isfinite(*value))
      fail("{} is not finite; write a number{}", node.text, in_unit(rule));
    if (!in_range(*value, rule))
      fail("{} is out of range; expected {}", node.text, describe_range(rule));
    return *value;
  }
  std::string text() const {
    if (!is_scalar() || node.text.empty()) wrong("a text");
    return node.text;
  }
  const std::vector<std::size_t>& list(CountRule count) const {
    if (node.kind != YamlNode::Kind::sequence) wrong("a list [..., ...]");
    if (node.items.size() < count.least || node.items.size() > count.most)
      fail("got {} entries; expected {}", node.items.size(), describe_count(count));
    return node.items;
  }
  /// Collects the errors of the items.
  template <typename Take>
  void for_each_item(CountRule count, Take take) const {
    for (const std::size_t item : list(count)) errors.attempt([&] { take(of(key, item)); });
  }
  template <typename Values, typename Parse>
  void take_names(Values& values, const char* right, Parse parse) const {
    if (node.kind != YamlNode::Kind::map) wrong(right);
    values.clear();
    for (const YamlNode::Entry& entry : node.entries)
      errors.attempt(
          [&] { values.emplace_back(entry.key, parse(of(entry.key.c_str(), entry.value))); });
  }
  void read_map(const std::string& place, const ConfigVisitor::Describe& describe) const;
};

void ConfigVisitor::number(const char* key, double& value, const NumberRule& rule,
                           Presence presence, const char* help) {
  visit({key, presence, help, "number", fmt::format("{}", value), describe_range(rule), rule.unit},
        [&](const ConfigValue& given) { value = given.number(rule); });
}

void ConfigVisitor::numbers(const char* key, std::vector<double>& values, const NumberRule& rule,
                            CountRule count, Presence presence, const char* help) {
  visit({key, presence, help, fmt::format("list of numbers, {}", describe_count(count)),
         fmt::format("[{}]", fmt::join(values, ", ")), describe_range(rule), rule.unit},
        [&](const ConfigValue& given) {
          values.clear();
          given.for_each_item(
              count, [&](const ConfigValue& item) { values.push_back(item.number(rule)); });
        });
}

void ConfigVisitor::integer(const char* key, std::int64_t& value, std::int64_t low,
                            std::int64_t high, Presence presence, const char* help) {
  visit({key, presence, help, "whole number", fmt::format("{}", value), describe_range(low, high)},
        [&](const ConfigValue& given) {
          const std::string& text = given.node.text;
          const char* end = text.data() + text.size();
          std::int64_t parsed = 0;
          const auto [stop, error] = std::from_chars(text.data(), end, parsed);
          if (!given.is_scalar() || !given.node.plain || stop != end || error != std::errc{})
            given.wrong("a whole number");
          if (parsed < low || parsed > high)
            given.fail("{} is out of range; expected {}", parsed, describe_range(low, high));
          value = parsed;
        });
}

void ConfigVisitor::text(const char* key, std::string& value, Presence presence, const char* help) {
  visit({key, presence, help, "text", value},
        [&](const ConfigValue& given) { value = given.text(); });
}

void ConfigVisitor::texts(const char* key, std::vector<std::string>& values, CountRule count,
                          Presence presence, const char* help) {
  visit({key, presence, help, fmt::format("list of texts, {}", describe_count(count)),
         fmt::format("[{}]", fmt::join(values, ", "))},
        [&](const ConfigValue& given) {
          values.clear();
          given.for_each_item(count, [&](const ConfigValue& item) {
            values.push_back(item.text());
            if (std::ranges::count(values, values.back()) > 1)
              item.fail("duplicate entry '{}'; keep one", values.back());
          });
        });
}

void ConfigVisitor::choice(const char* key, std::size_t& index,
                           const std::vector<std::string>& names, Presence presence,
                           const char* help) {
  const std::string forms =
      fmt::format("{}{}", names.size() > 1 ? "one of " : "", fmt::join(names, ", "));
  visit({key, presence, help, forms, names.at(index)}, [&](const ConfigValue& given) {
    if (!given.is_one_of(names)) given.wrong(forms + nearest_of(given.node, names));
    index = static_cast<std::size_t>(std::ranges::find(names, given.node.text) - names.begin());
  });
}

void ConfigVisitor::flexible(const char* key, FlexibleValue& value, const FlexibleRule& rule,
                             Presence presence, const char* help) {
  const std::string number = value.numbers.empty() ? "" : fmt::format("{}", value.numbers.front());
  // The range is included in the form.
  visit({key, presence, help, describe_forms(rule), value.word.empty() ? number : value.word, "",
         rule.rule.unit},
        [&](const ConfigValue& given) {
          FlexibleValue taken;  // keeps the default if invalid, so that later checks can continue
          const std::size_t errors = given.errors.size();
          if (given.node.kind == YamlNode::Kind::sequence && (rule.list || rule.pairs)) {
            taken.is_list = true;
            given.for_each_item({1}, [&](const ConfigValue& item) {
              if (!rule.pairs) return taken.numbers.push_back(item.number(rule.rule));
              const std::vector<std::size_t>& pair = item.list({2, 2});
              taken.pairs.emplace_back(item.of(key, pair[0]).number(rule.rule),
                                       item.of(key, pair[1]).number(rule.rule));
            });
          } else if (given.is_one_of(rule.words)) {
            taken.word = given.node.text;
          } else if (given.is_scalar() && rule.number && looks_numeric(given.node)) {
            taken.numbers = {given.number(rule.rule)};
          } else if (given.is_scalar() && rule.any_text && !given.node.text.empty()) {
            taken.word = given.node.text;
          } else {
            given.wrong(describe_forms(rule) + nearest_of(given.node, rule.words));
          }
          if (given.errors.size() == errors) value = std::move(taken);
        });
}

void ConfigVisitor::named_numbers(const char* key,
                                  std::vector<std::pair<std::string, double>>& values,
                                  const NumberRule& rule, Presence presence, const char* help) {
  visit({key, presence, help, "map of name: number", "{}", describe_range(rule), rule.unit},
        [&](const ConfigValue& given) {
          given.take_names(values, "a map {name: number, ...}",
                           [&](const ConfigValue& named) { return named.number(rule); });
        });
}

void ConfigVisitor::named_texts(const char* key,
                                std::vector<std::pair<std::string, std::string>>& values,
                                Presence presence, const char* help) {
  visit({key, presence, help, "map of name: text", "{}"}, [&](const ConfigValue& given) {
    given.take_names(values, "a map {name: text, ...}", [](const ConfigValue& named) {
      if (!named.is_scalar()) named.wrong("a text");
      return named.node.text;
    });
  });
}

void ConfigVisitor::group(const char* key, const Describe& describe, Presence presence,
                          const char* help) {
  visit({key, presence, help, "map", "", "", "", &describe},
        [&](const ConfigValue& given) { given.read_map(key, describe); });
}

void ConfigVisitor::group_or_text(const char* key, const Describe& describe, std::string& text,
                                  Presence presence, const char* help) {
  visit({key, presence, help, "map or text", "", "", "", &describe}, [&](const ConfigValue& given) {
    if (given.is_scalar() && !given.node.text.empty())
      text = given.node.text;
    else
      given.read_map(key, describe);
  });
}

void ConfigVisitor::items(const char* key, const Describe& describe_item, CountRule count,
                          Presence presence, const char* help) {
  visit({key, presence, help, fmt::format("list of maps, {}", describe_count(count)), "[]", "", "",
         &describe_item},
        [&](const ConfigValue& given) {
          std::size_t index = 0;
          for (const std::size_t item : given.list(count))
            given.of(key, item).read_map(fmt::format("{} {}", key, ++index), describe_item);
        });
}

namespace {

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

  void read(const Describe& describe) {
    describe(*this);
    finish();
  }

  void require(bool holds, const char* key, const std::string& message) override {
    if (holds) return;
    const YamlNode* value = document_.value(map_, key);
    broken_.emplace_back(value == nullptr ? map_.mark : value->mark, message);
  }

 private:
  /// Collects the errors.
  void visit(const Key& key, const std::function<void(const ConfigValue&)>& take) override {
    known_.emplace_back(key.key);
    const YamlNode* value = document_.value(map_, key.key);
    if (value == nullptr) {
      if (key.presence == Presence::required) missing_.emplace_back(key.key, key.help);
      return;
    }
    const ConfigValue given{document_, errors_, key.key, *value};
    if (known_.back() == "format")
      take(given);  // a file of another kind has other keys
    else
      errors_.attempt([&] { take(given); });
  }

  /// Keys without a description are unknown. Missing keys are reported only if there are no unknown ones, which may be
  /// misspelt. Rules between values are checked only if the values are valid.
  void finish() const {
    const auto report = [&](const YamlMark& mark, const std::string& message) {
      errors_.attempt([&] { document_.fail(mark, message); });
    };
    bool unknown = false;
    for (const YamlNode::Entry& entry : map_.entries) {
      if (std::ranges::find(known_, entry.key) != known_.end()) continue;
      unknown = true;
      report(entry.mark,
             fmt::format("unknown key '{}'; {}", entry.key, suggest_key(entry.key, known_)));
    }
    if (!unknown)
      for (const auto& [key, help] : missing_)
        report(map_.mark, fmt::format("key '{}' is missing{}; add it ({})", key,
                                      place_.empty() ? "" : " in " + place_, help));
    if (errors_.size() > errors_before_) return;
    for (const auto& [mark, message] : broken_) report(mark, message);
  }

  const YamlDocument& document_;
  const YamlNode& map_;
  std::string place_;
  FormatErrorList& errors_;
  std::size_t errors_before_ = 0;
  std::vector<std::string> known_;
  std::vector<std::pair<std::string, std::string>> missing_;  ///< keys and their help
  std::vector<std::pair<YamlMark, std::string>> broken_;      ///< rules
};

}  // namespace

void ConfigValue::read_map(const std::string& place,
                           const ConfigVisitor::Describe& describe) const {
  errors.attempt([&] { MapReader(document, node, place, errors).read(describe); });
}

void read_config(const YamlDocument& document, const ConfigVisitor::Describe& describe) {
  FormatErrorList errors;
  errors.attempt([&] { MapReader(document, document.root(), "", errors).read(describe); });
  errors.raise();
}

}  // namespace stageid
