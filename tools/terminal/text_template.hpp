#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace stageid {

/// Replaces every @name@ of a text by its value, from left to right. Values are not scanned again, and other text remains
/// as it is.
std::string fill_template(std::string_view text,
                          const std::vector<std::pair<std::string_view, std::string_view>>& values);

}  // namespace stageid
