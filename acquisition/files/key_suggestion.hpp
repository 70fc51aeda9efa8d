#pragma once

#include <string>
#include <vector>

namespace stageid {

/// What to say after "unknown key 'X'; ": the same key in another unit, the nearest spelling, or the
/// list of keys that are allowed.
std::string suggest_key(const std::string& unknown, const std::vector<std::string>& allowed);

/// The nearest of `allowed`: equal but for case, or by edit distance (a swap of neighbours counts one); empty
/// if none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& allowed);

}  // namespace stageid
