#pragma once

#include <string>
#include <vector>

namespace stageid {

/// Text to follow "unknown key 'X'; ": the same key in another unit, the nearest spelling, or the list of
/// permitted keys.
std::string suggest_key(const std::string& unknown, const std::vector<std::string>& allowed);

/// The nearest of `allowed`: equal except for case, the only one that starts with `word`, or by edit distance (a
/// swap of neighbours counts as one). Empty if none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& allowed);

/// " (did you mean 'X'?)" with the nearest word, to follow a list of them; empty if none is near.
std::string nearest_hint(const std::string& word, const std::vector<std::string>& allowed);

}  // namespace stageid
