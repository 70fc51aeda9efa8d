#pragma once

#include <string>
#include <vector>

#include "tools/report/report.hpp"

namespace stageid::report {

/// A block of encoded numbers and the name of the element that holds it.
struct Block {
  std::string id;      ///< "response", ...: [a-z_]+
  std::string base64;  ///< see report_encoding.hpp and report_packing.hpp
};

/// Everything the page's script reads.
struct PageContent {
  std::string json;  ///< safe inside <script>: no '<', valid UTF-8 whatever came in
  std::vector<Block> blocks;
};

/// @pre shapes were checked by report_page()
PageContent page_content(const ReportData& data);

}  // namespace stageid::report
