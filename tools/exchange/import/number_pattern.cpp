#include "tools/exchange/import/number_pattern.hpp"

#include <algorithm>
#include <regex>
#include <string_view>
#include <system_error>
#include <utility>

#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

constexpr std::string_view kRealization = "{realization}";
constexpr std::string_view kExperiment = "{experiment}";

struct Expression {
  std::regex regex;
  std::vector<bool> is_realization;  ///< per group: realization, else experiment
};

Expression expression_of(const std::string& pattern) {
  std::string text;
  Expression out;
  for (std::string_view rest = pattern; !rest.empty();) {
    const bool realization = rest.starts_with(kRealization);
    if (realization || rest.starts_with(kExperiment)) {
      const std::string_view key = realization ? kRealization : kExperiment;
      if (std::ranges::count(out.is_realization, realization) > 0)
        fail_request("'{}' contains {} twice; keep one", pattern, key);
      out.is_realization.push_back(realization);
      text += "([0-9]{1,18})";
      rest.remove_prefix(key.size());
      continue;
    }
    if (std::string_view(".^$|()[]{}*+?\\").find(rest.front()) != std::string_view::npos)
      text += '\\';
    text += rest.front();
    rest.remove_prefix(1);
  }
  out.regex = std::regex(text);
  return out;
}

std::optional<RunNumbers> match(const Expression& expression, const std::string& text) {
  std::smatch found;
  if (!std::regex_match(text, found, expression.regex)) return std::nullopt;
  RunNumbers numbers;
  for (std::size_t k = 0; k < expression.is_realization.size(); ++k)
    (expression.is_realization[k] ? numbers.realization : numbers.experiment) =
        std::stoll(found[k + 1]);
  return numbers;
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
      fail_request("'{}' and '{}' have the same numbers under '{}'; rename or remove one",
                   place->second, text, pattern);
  }
  return out;
}

std::map<RunNumbers, std::string> files_of(const std::filesystem::path& pattern) {
  std::vector<std::filesystem::path> found = {pattern.root_path()};
  for (const std::filesystem::path& component : pattern.relative_path()) {
    std::vector<std::filesystem::path> next;
    std::error_code error;
    for (const std::filesystem::path& folder : found) {
      if (!is_pattern(component.string())) {
        if (std::filesystem::exists(folder / component, error)) next.push_back(folder / component);
        continue;
      }
      const Expression expression = expression_of(component.string());
      for (const auto& entry :
           std::filesystem::directory_iterator(folder.empty() ? "." : folder, error))
        if (match(expression, entry.path().filename().string()))
          next.push_back(folder / entry.path().filename());
    }
    found = std::move(next);
  }
  return matches_of(pattern.string(), {found.begin(), found.end()});
}

}  // namespace stageid
