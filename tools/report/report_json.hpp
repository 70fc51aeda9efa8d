#pragma once

#include <string>
#include <vector>

#include "tools/report/report_page.hpp"

namespace stageid::report {

/// A block of encoded numbers and the name of the element that holds it.
struct Block {
  std::string id;      ///< "response", ...: [a-z_]+
  std::string base64;  ///< see report_encoding.hpp
};

/// Data for the script of the page.
struct PageContent {
  std::string json;  ///< safe inside <script>: no '<', always valid UTF-8
  std::vector<Block> blocks;
};

/// @pre as report_page(), which checks that the parts belong together
PageContent page_content(const ReportData& data);

}  // namespace stageid::report
