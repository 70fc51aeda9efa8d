#pragma once

#include <string_view>

namespace stageid::report {

// The sources of the page and the plot library, embedded by stageid_embed().
extern const std::string_view page_html;  ///< see html_page()
extern const std::string_view dashboard_css;
extern const std::string_view dashboard_js;
extern const std::string_view fleet_js;
extern const std::string_view workbench_css;
extern const std::string_view workbench_js;
extern const std::string_view page_css;
extern const std::string_view page_js;
extern const std::string_view library_css;
extern const std::string_view library_js;
extern const std::string_view library_licence;

}  // namespace stageid::report
