#pragma once

#include <string_view>

namespace stageid::report {

// The page's own sources and the plot library, built into the program by tools/report/embed.cmake.
extern const std::string_view
    page_html;  ///< with {{title}}, {{style}}, {{library}}, ... to fill in
extern const std::string_view dashboard_html;  ///< the same with {{dashboard_css}}
extern const std::string_view dashboard_css;
extern const std::string_view dashboard_js;
extern const std::string_view page_css;
extern const std::string_view page_js;
extern const std::string_view library_css;
extern const std::string_view library_js;
extern const std::string_view library_licence;

}  // namespace stageid::report
