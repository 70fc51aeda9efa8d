#include "tools/commands/usage_problem.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "acquisition/files/key_suggestion.hpp"

namespace stageid {
namespace {

/// The text before and after `middle`.
std::optional<std::pair<std::string, std::string>> split_at(const std::string& text,
                                                            std::string_view middle) {
  const std::size_t at = text.find(middle);
  if (at == std::string::npos) return std::nullopt;
  return std::pair(text.substr(0, at), text.substr(at + middle.size()));
}

/// "--band: At least 2 required but received 1", "--output: 1 required TEXT missing"
std::string mismatch(const std::string& what) {
  for (const auto& [theirs, ours] :
       {std::pair(": At least ", "at least"), std::pair(": At Most ", "at most")})
    if (const auto halves = split_at(what, theirs))
      if (const auto counts = split_at(halves->second, " required but received "))
        return fmt::format("{}: got {} value{}; expected {} {}", halves->first, counts->second,
                           counts->second == "1" ? "" : "s", ours, counts->first);
  if (const auto halves = split_at(what, ": "); halves && halves->second.ends_with(" missing"))
    return halves->first + ": the value is missing";
  return what;
}

/// "--method: lmp not in {periodic,lpm}", with the names in the first braces of `choices`
std::string choice(const std::string& place, const std::string& got, const std::string& choices) {
  std::istringstream list(choices.substr(0, choices.find('}')));
  std::vector<std::string> names;
  for (std::string name; std::getline(list, name, ',');)
    names.push_back(name.substr(0, name.find("->")));  // verbosity: quiet->0
  const std::string nearest = nearest_word(got, names);
  return fmt::format("{}: got '{}'; expected one of {}{}", place, got, fmt::join(names, ", "),
                     nearest.empty() ? "" : fmt::format(" (did you mean '{}'?)", nearest));
}

std::string invalid(const std::string& what) {
  const auto halves = split_at(what, ": ");
  if (!halves) return what;
  const auto& [place, problem] = *halves;
  if (const auto set = split_at(problem, " not in {"))
    return choice(place, set->first, set->second);
  if (const auto set = split_at(problem, " value in {"); set && set->first.starts_with("Check "))
    return choice(place, set->first.substr(6), set->second);
  if (const auto range = split_at(problem, " not in range ");
      range && range->first.starts_with("Value "))
    if (const auto ends = split_at(range->second, " to "))
      return fmt::format("{}: got '{}'; expected {} to {}", place, range->first.substr(6),
                         std::stod(ends->first), std::stod(ends->second));  // 60, not 60.000000
  return what;
}

}  // namespace

std::string usage_problem(const CLI::ParseError& error) {
  std::string what = error.what();
  std::replace(what.begin(), what.end(), '\n', ' ');
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) return mismatch(what);
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr) return invalid(what);
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr)
    if (const auto halves = split_at(what, "Could not convert: "))
      if (const auto value = split_at(halves->second, " = "))
        return fmt::format("{}: got '{}'; expected a number", value->first, value->second);
  return what;
}

}  // namespace stageid
