#include "tools/exchange/import/number_pattern.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <regex>
#include <stdexcept>
#include <system_error>

namespace stageid {
namespace {

constexpr const char* kRealization = "{realization}";
constexpr const char* kExperiment = "{experiment}";

struct Expression {
  std::regex regex;
  std::vector<bool> is_realization;  ///< per group: realization, else experiment
};

Expression expression_of(const std::string& pattern) {
  std::string text;
  Expression out;
  for (std::size_t at = 0; at < pattern.size();) {
    const bool realization =
        pattern.compare(at, std::string(kRealization).size(), kRealization) == 0;
    const bool experiment = pattern.compare(at, std::string(kExperiment).size(), kExperiment) == 0;
    if (realization || experiment) {
      if (std::count(out.is_realization.begin(), out.is_realization.end(), realization) > 0)
        throw std::invalid_argument(fmt::format("'{}' contains {} twice; keep one", pattern,
                                                realization ? kRealization : kExperiment));
      out.is_realization.push_back(realization);
      text += "([0-9]{1,18})";
      at += std::string(realization ? kRealization : kExperiment).size();
      continue;
    }
    if (std::string(".^$|()[]{}*+?\\").find(pattern[at]) != std::string::npos) text += '\\';
    text += pattern[at++];
  }
  out.regex = std::regex(text);
  return out;
}

std::optional<RunNumbers> match(const Expression& expression, const std::string& text) {
  std::smatch found;
  if (!std::regex_match(text, found, expression.regex)) return std::nullopt;
  RunNumbers numbers;
  for (std::size_t k = 0; k < expression.is_realization.size(); ++k) {
    const std::string digits = found[k + 1].str();
    long long value = 0;
    std::from_chars(digits.data(), digits.data() + digits.size(), value);
    (expression.is_realization[k] ? numbers.realization : numbers.experiment) = value;
  }
  return numbers;
}

void collect(const std::filesystem::path& folder, std::vector<std::string> components,
             std::vector<std::string>& found) {
  if (components.empty()) {
    found.push_back(folder.string());
    return;
  }
  const std::string component = components.front();
  components.erase(components.begin());
  if (!is_pattern(component)) {
    const std::filesystem::path next = folder / component;
    std::error_code error;
    if (std::filesystem::exists(next, error)) collect(next, components, found);
    return;
  }
  const Expression expression = expression_of(component);
  std::error_code error;
  const std::filesystem::path listed = folder.empty() ? std::filesystem::path(".") : folder;
  for (const auto& entry : std::filesystem::directory_iterator(listed, error)) {
    const std::string name = entry.path().filename().string();
    if (match(expression, name)) collect(folder / name, components, found);
  }
}

}  // namespace

bool is_pattern(const std::string& text) {
  return text.find(kRealization) != std::string::npos ||
         text.find(kExperiment) != std::string::npos;
}

std::map<RunNumbers, std::string> matches_of(const std::string& pattern,
                                             const std::vector<std::string>& texts) {
  const Expression expression = expression_of(pattern);
  std::map<RunNumbers, std::string> out;
  for (const std::string& text : texts) {
    const std::optional<RunNumbers> numbers = match(expression, text);
    if (!numbers) continue;
    const auto [place, is_new] = out.emplace(*numbers, text);
    if (!is_new)
      throw std::invalid_argument(
          fmt::format("'{}' and '{}' have the same numbers under '{}'; rename or remove one",
                      place->second, text, pattern));
  }
  return out;
}

std::map<RunNumbers, std::filesystem::path> files_of(const std::filesystem::path& pattern) {
  std::vector<std::string> components;
  for (const auto& component : pattern.relative_path()) components.push_back(component.string());
  std::vector<std::string> found;
  collect(pattern.root_path(), components, found);
  std::map<RunNumbers, std::filesystem::path> out;
  for (const auto& [numbers, file] : matches_of(pattern.string(), found))
    out.emplace(numbers, file);
  return out;
}

}  // namespace stageid
