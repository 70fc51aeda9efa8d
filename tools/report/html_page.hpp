#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace stageid {

/// Escapes JSON for use inside <script>: no '<'. @pre `json` is JSON.
std::string script_safe(std::string_view json);

enum class HtmlPage : std::uint8_t { report, dashboard };

/// One self-contained page with its script, its styles and the plot library.
/// @param title plain text
/// @param content script_safe() JSON for the script
/// @param blocks elements with packed numbers
std::string html_page(HtmlPage page, std::string_view title, std::string_view content,
                      std::string_view blocks = {});

}  // namespace stageid
