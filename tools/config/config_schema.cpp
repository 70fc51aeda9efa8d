#include "tools/config/config_schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <tuple>

#include "tools/config/number_range.hpp"

namespace stageid {
namespace {

class SchemaCollector final : public ConfigVisitor {
 public:
  void number(const char* key, double& value, const NumberRule& rule, Presence presence,
              const char* help) override {
    add(key, "number", fmt::format("{}", value), presence, help, describe_range(rule), rule.unit);
  }
  void numbers(const char* key, std::vector<double>& values, const NumberRule& rule,
               CountRule count, Presence presence, const char* help) override {
    add(key, fmt::format("list of numbers, {}", describe_count(count)),
        fmt::format("[{}]", fmt::join(values, ", ")), presence, help, describe_range(rule),
        rule.unit);
  }
  void integer(const char* key, std::int64_t& value, std::int64_t low, std::int64_t high,
               Presence presence, const char* help) override {
    add(key, "whole number", fmt::format("{}", value), presence, help, describe_range(low, high));
  }
  void text(const char* key, std::string& value, Presence presence, const char* help) override {
    add(key, "text", value, presence, help);
  }
  void texts(const char* key, std::vector<std::string>& values, CountRule count, Presence presence,
             const char* help) override {
    add(key, fmt::format("list of texts, {}", describe_count(count)),
        fmt::format("[{}]", fmt::join(values, ", ")), presence, help);
  }
  void choice(const char* key, std::size_t& index, const std::vector<std::string>& names,
              Presence presence, const char* help) override {
    add(key, fmt::format("{}{}", names.size() > 1 ? "one of " : "", fmt::join(names, ", ")),
        names.at(index), presence, help);
  }
  void flexible(const char* key, FlexibleValue& value, const FlexibleRule& rule, Presence presence,
                const char* help) override {
    const std::string numbers =
        value.numbers.empty() ? "" : fmt::format("{}", value.numbers.front());
    // The range is included in the form.
    add(key, describe_forms(rule), value.word.empty() ? numbers : value.word, presence, help, "",
        rule.rule.unit);
  }
  void named_numbers(const char* key, std::vector<std::pair<std::string, double>>&,
                     const NumberRule& rule, Presence presence, const char* help) override {
    add(key, "map of name: number", "{}", presence, help, describe_range(rule), rule.unit);
  }
  void named_texts(const char* key, std::vector<std::pair<std::string, std::string>>&,
                   Presence presence, const char* help) override {
    add(key, "map of name: text", "{}", presence, help);
  }
  void group(const char* key, const Describe& describe, Presence presence,
             const char* help) override {
    add(key, "map", "", presence, help);
    descend(describe);
  }
  void group_or_text(const char* key, const Describe& describe, std::string&, Presence presence,
                     const char* help) override {
    add(key, "map or text", "", presence, help);
    descend(describe);
  }
  void items(const char* key, const Describe& describe_item, CountRule count, Presence presence,
             const char* help) override {
    add(key, fmt::format("list of maps, {}", describe_count(count)), "[]", presence, help);
    descend(describe_item);
  }
  void require(bool, const char*, const std::string&) override {}

  std::vector<SchemaEntry> take() { return std::move(entries_); }

 private:
  void add(const char* key, std::string type, std::string default_value, Presence presence,
           const char* help, std::string range = {}, std::string_view unit = {}) {
    const bool required = presence == Presence::required;
    entries_.push_back({depth_, key, std::move(type), std::string(unit), std::move(range),
                        required ? "" : std::move(default_value), required, help});
  }
  void descend(const Describe& describe) {
    ++depth_;
    describe(*this);
    --depth_;
  }

  int depth_ = 0;
  std::vector<SchemaEntry> entries_;
};

/// One past the last key in the group at `k`; k + 1 if it is no group.
std::size_t end_of_group(const std::vector<SchemaEntry>& entries, std::size_t k) {
  std::size_t end = k + 1;
  while (end < entries.size() && entries[end].depth > entries[k].depth) ++end;
  return end;
}

/// The key of the first of the equal groups just before [k, end); null if there is none.
const std::string* same_group_before(const std::vector<SchemaEntry>& entries, std::size_t k,
                                     std::size_t end) {
  const std::size_t size = end - k;
  if (k < size || end_of_group(entries, k - size) != k) return nullptr;
  const auto first = entries.begin() + (k - size);
  const auto same = [](const SchemaEntry& a, const SchemaEntry& b) {
    return std::tie(a.depth, a.key, a.type, a.range, a.default_value, a.required, a.help) ==
           std::tie(b.depth, b.key, b.type, b.range, b.default_value, b.required, b.help);
  };
  const auto last = first + static_cast<std::ptrdiff_t>(size);
  if (!std::equal(first + 1, last, last + 1, same)) return nullptr;
  const std::string* earlier = same_group_before(entries, k - size, k);
  return earlier != nullptr ? earlier : &first->key;
}

}  // namespace

std::vector<SchemaEntry> config_schema(const ConfigVisitor::Describe& describe) {
  SchemaCollector collector;
  describe(collector);
  return collector.take();
}

std::string schema_text(const std::vector<SchemaEntry>& entries) {
  std::string text;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const SchemaEntry& entry = entries[k];
    std::vector<std::string> notes = {entry.type};
    if (!entry.range.empty()) notes.push_back(entry.range);
    if (entry.required) notes.emplace_back("required");
    if (!entry.default_value.empty())
      notes.push_back(fmt::format("default {}", entry.default_value));
    const std::size_t end = end_of_group(entries, k);
    const std::string* like = end > k + 1 ? same_group_before(entries, k, end) : nullptr;
    if (like != nullptr) notes = {fmt::format("the keys of {}", *like)};
    const std::string key = std::string(2 * entry.depth, ' ') + entry.key + ":";
    text += fmt::format("{:<28} # {} ({})\n", key, entry.help, fmt::join(notes, "; "));
    if (like != nullptr) k = end - 1;
  }
  return text;
}

}  // namespace stageid
