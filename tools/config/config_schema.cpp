#include "tools/config/config_schema.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <tuple>

namespace stageid {
namespace {

class SchemaCollector final : public ConfigVisitor {
 public:
  void require(bool, const char*, const std::string&) override {}
  std::vector<SchemaEntry> take() { return std::move(entries_); }

 private:
  void visit(const Key& key, const std::function<void(const ConfigValue&)>&) override {
    const bool required = key.presence == Presence::required;
    entries_.push_back({depth_, key.key, key.type, std::string(key.unit), key.range,
                        required ? "" : key.default_value, required, key.help});
    if (key.inner == nullptr) return;
    ++depth_;
    (*key.inner)(*this);
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
