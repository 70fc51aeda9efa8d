#include "tools/config/number_range.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

namespace stageid {

bool in_range(double value, const NumberRule& rule) {
  const bool low_enough = value <= rule.high;
  return low_enough && (rule.low_excluded ? value > rule.low : value >= rule.low);
}

std::string describe_range(const NumberRule& rule) {
  const std::string unit = rule.unit.empty() ? "" : fmt::format(" {}", rule.unit);
  const bool bounded_below = std::isfinite(rule.low);
  if (bounded_below && std::isfinite(rule.high))
    return fmt::format("{}{} ... {}{}", rule.low_excluded ? "above " : "", rule.low, rule.high,
                       unit);
  if (bounded_below) return fmt::format("{} {}{}", rule.low_excluded ? ">" : ">=", rule.low, unit);
  if (std::isfinite(rule.high)) return fmt::format("<= {}{}", rule.high, unit);
  return fmt::format("any finite number{}",
                     rule.unit.empty() ? "" : fmt::format(" in {}", rule.unit));
}

std::string describe_range(std::int64_t low, std::int64_t high) {
  if (high == std::numeric_limits<std::int64_t>::max()) return fmt::format("at least {}", low);
  return fmt::format("{} ... {}", low, high);
}

std::string describe_count(CountRule count) {
  if (count.least == count.most) return fmt::format("{}", count.least);
  if (count.most == std::numeric_limits<std::size_t>::max())
    return count.least == 0 ? "any number" : fmt::format("{} or more", count.least);
  return fmt::format("{} to {}", count.least, count.most);
}

std::string describe_forms(const FlexibleRule& rule) {
  std::vector<std::string> forms;
  const std::string range = describe_range(rule.rule);
  for (const std::string& word : rule.words) forms.push_back(fmt::format("'{}'", word));
  if (rule.number) forms.push_back(fmt::format("a number ({})", range));
  if (rule.list) forms.push_back("a list of numbers");
  if (rule.pairs) forms.push_back("a list of pairs [number, number]");
  if (rule.any_text) forms.push_back(std::string(rule.text_meaning));
  return fmt::format("{}", fmt::join(forms, " or "));
}

}  // namespace stageid
