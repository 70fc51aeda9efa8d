#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace stageid {

/// Text as it may stand between and inside elements: & < > " are replaced.
std::string escape_html(std::string_view text);

/// JSON as it may stand inside <script>: no '<'. @pre `json` is JSON.
std::string script_safe(std::string_view json);

/// Replaces every {{name}} of the template once, from left to right, so that nothing that was put in
/// is looked at again. A name that is not among the parts becomes nothing.
std::string fill_page(std::string_view page,
                      const std::vector<std::pair<std::string_view, std::string_view>>& parts);

}  // namespace stageid
