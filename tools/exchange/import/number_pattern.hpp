#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace stageid {

/// The numbers of a run in a name: "run_2_13.mat" matches the pattern "run_{realization}_{experiment}.mat".
struct RunNumbers {
  std::optional<long long> realization, experiment;
  friend auto operator<=>(const RunNumbers&, const RunNumbers&) = default;
};

/// Whether {realization} or {experiment} is in a text.
bool is_pattern(const std::string& text);

/// The texts that match, sorted by their numbers, which may have leading zeros.
/// @throws std::invalid_argument if two of them have the same numbers, or a placeholder occurs twice in the pattern
std::map<RunNumbers, std::string> matches_of(const std::string& pattern,
                                             const std::vector<std::string>& texts);

/// The same for files; folders may contain placeholders too.
std::map<RunNumbers, std::string> files_of(const std::filesystem::path& pattern);

}  // namespace stageid
