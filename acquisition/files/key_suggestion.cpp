#include "acquisition/files/key_suggestion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <strings.h>

#include <algorithm>
#include <array>
#include <string_view>

namespace stageid {
namespace {

// Suffixes that denote a unit: those of stageid, then common alternatives.
constexpr std::array kUnits = {"hz", "s",  "m",  "n",   "kg",    "rms", "khz",  "rad",
                               "ms", "us", "ns", "mm",  "um",    "nm",  "v",    "a",
                               "mn", "kn", "g",  "deg", "kg_m2", "n_s", "n_m3", "n_m"};

/// Optimal string alignment: insertions, deletions, replacements, swaps of neighbours.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i)
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replace = a[i - 1] == b[j - 1] ? 0 : 1;
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + replace});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

/// "rms_n" -> "rms"; a key without a unit is its own stem.
std::string_view stem(std::string_view key) {
  for (std::size_t at = key.find('_'); at != std::string_view::npos; at = key.find('_', at + 1))
    if (std::find(kUnits.begin(), kUnits.end(), key.substr(at + 1)) != kUnits.end())
      return key.substr(0, at);
  return key;
}

/// The only word that starts with `beginning`, of three letters or more: "conv" for "convert".
std::string whole_word(const std::string& beginning, const std::vector<std::string>& allowed) {
  const auto begins = [&](const std::string& candidate) {
    return candidate.starts_with(beginning);
  };
  if (beginning.size() < 3 || std::count_if(allowed.begin(), allowed.end(), begins) != 1) return "";
  return *std::find_if(allowed.begin(), allowed.end(), begins);
}

}  // namespace

std::string nearest_word(const std::string& word, const std::vector<std::string>& allowed) {
  std::string best;
  std::size_t least = std::max<std::size_t>(1, std::min<std::size_t>(3, word.size() / 3)) + 1;
  if (word.size() > 64) return best;
  const auto same = std::find_if(allowed.begin(), allowed.end(), [&](const std::string& candidate) {
    return ::strcasecmp(word.c_str(), candidate.c_str()) == 0;
  });
  if (same != allowed.end()) return *same;
  if (std::string whole = whole_word(word, allowed); !whole.empty()) return whole;
  for (const std::string& candidate : allowed) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < least) {
      least = distance;
      best = candidate;
    }
  }
  return best;
}

std::string nearest_hint(const std::string& word, const std::vector<std::string>& allowed) {
  const std::string nearest = nearest_word(word, allowed);
  return nearest.empty() ? "" : fmt::format(" (did you mean '{}'?)", nearest);
}

std::string suggest_key(const std::string& unknown, const std::vector<std::string>& allowed) {
  for (const std::string& key : allowed)
    if (stem(key) == stem(unknown) && key != unknown && stem(key) != key)
      return fmt::format("the key includes the unit; write '{}'", key);
  const std::string nearest = nearest_word(unknown, allowed);
  if (!nearest.empty()) return fmt::format("did you mean '{}'?", nearest);
  if (allowed.empty()) return "no keys are allowed here";
  return fmt::format("allowed keys: {}", fmt::join(allowed, ", "));
}

}  // namespace stageid
