#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace stageid {

/// Escapes JSON for use inside <script>: no '<'. @pre `json` is JSON.
std::string script_safe(std::string_view json);

enum class HtmlPage : std::uint8_t { report, dashboard, fleet, workbench };

namespace report {

/// A block of encoded numbers and the name of the element that holds it.
struct Block {
  std::string id;      ///< "response", ...: [a-z_]+
  std::string base64;  ///< see report_encoding.hpp
};

}  // namespace report

/// One self-contained page with its script, its styles and the plot library.
/// @param title plain text
/// @param content script_safe() JSON for the script
std::string html_page(HtmlPage page, std::string_view title, std::string_view content,
                      const std::vector<report::Block>& blocks = {});

}  // namespace stageid
