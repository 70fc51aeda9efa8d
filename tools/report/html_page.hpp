#pragma once

#include <string>
#include <string_view>

namespace stageid {

/// Escapes JSON for use inside <script>: no '<'. @pre `json` is JSON.
std::string script_safe(std::string_view json);

/// What the report and the dashboard have of their own.
struct HtmlPage {
  std::string title;                ///< plain text
  std::string_view object;          ///< name of the script's object in `window`
  std::string_view policy;          ///< more directives of the content security policy
  std::string_view without_script;  ///< shown if scripts are disabled
  std::string_view css;             ///< besides that of the report
  std::string_view js;
  std::string content;  ///< script_safe() JSON, with the id "content"
  std::string blocks;   ///< elements with packed numbers
};

/// One self-contained page with the styles of the report and the plot library.
std::string html_page(const HtmlPage& page);

}  // namespace stageid
