#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace stageid {

/// Escapes text for use between and inside elements: & < > " are replaced.
std::string escape_html(std::string_view text);

/// Escapes JSON for use inside <script>: no '<'. @pre `json` is JSON.
std::string script_safe(std::string_view json);

/// Replaces every {{name}} of the template once, from left to right; inserted text is not scanned again. Unknown names
/// are replaced by nothing.
std::string fill_page(std::string_view page,
                      const std::vector<std::pair<std::string_view, std::string_view>>& parts);

}  // namespace stageid
