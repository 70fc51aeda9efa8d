#include "tools/report/html_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "tools/report/report_assets.hpp"
#include "tools/terminal/text_template.hpp"

namespace stageid {
namespace {

std::string replaced(std::string_view text,
                     const std::vector<std::pair<char, std::string_view>>& replacements) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    const auto found =
        std::ranges::find(replacements, c, &std::pair<char, std::string_view>::first);
    if (found == replacements.end())
      out += c;
    else
      out += found->second;
  }
  return out;
}

/// For use between and inside elements.
std::string escape_html(std::string_view text) {
  return replaced(text, {{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}});
}

std::string block_elements(const std::vector<report::Block>& blocks) {
  std::string out;
  for (const report::Block& block : blocks)
    out += fmt::format("<script type=\"text/plain\" id=\"data-{}\">{}</script>\n", block.id,
                       block.base64);
  return out;
}

/// The differences between pages.
struct PageKind {
  const char* object;  ///< of the script, for tests and support
  const char* policy;  ///< more of the security policy
  const char* without_script;
  std::string_view css;
  std::string_view js;
};

PageKind kind_of(HtmlPage page) {
  constexpr const char* kWithoutScript =
      "This report needs JavaScript, which is included in this file; enable scripts to see the "
      "plots.";
  constexpr const char* kServed = "; connect-src 'self'; base-uri 'none'; form-action 'none'";
  switch (page) {
    case HtmlPage::dashboard:
      return {"stageidDashboard", kServed,
              "The dashboard needs JavaScript, which is included in this page; enable scripts to "
              "see it.",
              report::dashboard_css, report::dashboard_js};
    case HtmlPage::fleet:
      return {"stageidFleet", "", kWithoutScript, "", report::fleet_js};
    case HtmlPage::workbench:
      return {"stageidReport", kServed,
              "The workbench needs JavaScript, which is included in this page; enable scripts to "
              "use it.",
              report::workbench_css, report::workbench_js};
    case HtmlPage::report:
      break;
  }
  return {"stageidReport", "", kWithoutScript, "", report::page_js};
}

}  // namespace

// Within <script> only "</script" and "<!--" are special, and both begin with '<'.
std::string script_safe(std::string_view json) { return replaced(json, {{'<', "\\u003c"}}); }

std::string html_page(HtmlPage page, std::string_view title, std::string_view content,
                      const std::vector<report::Block>& blocks) {
  const PageKind kind = kind_of(page);
  return fill_template(report::page_html, {{"title", escape_html(title)},
                                           {"object", kind.object},
                                           {"policy", kind.policy},
                                           {"without_script", kind.without_script},
                                           {"library_css", report::library_css},
                                           {"css", report::page_css},
                                           {"more_css", kind.css},
                                           {"library_js", report::library_js},
                                           {"js", kind.js},
                                           {"licence", escape_html(report::library_licence)},
                                           {"content", content},
                                           {"blocks", block_elements(blocks)}});
}

}  // namespace stageid
