#pragma once

#include <string>
#include <vector>

#include "tools/config/config_visitor.hpp"

namespace stageid {

/// One key of a configuration with its description.
struct SchemaEntry {
  int depth = 0;  ///< 0: top level
  std::string key;
  std::string type;           ///< "number", "list of maps", "one of a, b"
  std::string unit;           ///< "s"; empty: none
  std::string range;          ///< "> 0 s"; empty: any
  std::string default_value;  ///< empty: none
  bool required = false;
  std::string help;
};

std::vector<SchemaEntry> config_schema(const ConfigVisitor::Describe& describe);

/// Text for people: one line per key, indented as in the file.
std::string schema_text(const std::vector<SchemaEntry>& entries);

}  // namespace stageid
