#pragma once

#include <string>
#include <vector>

#include "tools/report/html_page.hpp"
#include "tools/report/report_page.hpp"

namespace stageid::report {

/// Data for the script of the page.
struct PageContent {
  std::string json;  ///< safe inside <script>: no '<', always valid UTF-8
  std::vector<Block> blocks;
};

/// @pre as report_page(), which checks that the parts belong together
PageContent page_content(const ReportData& data);

}  // namespace stageid::report
