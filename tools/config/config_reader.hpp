#pragma once

#include <string>
#include <vector>

#include "tools/config/config_visitor.hpp"
#include "tools/config/strict_yaml.hpp"

namespace stageid {

/// Fills a configuration from a document: every key that stands there must be known, every required
/// one must stand there, every value must have its type and lie in its range.
/// @throws FormatErrors, each "FILE:LINE:COLUMN: what is wrong; what would be right".
void read_config(const YamlDocument& document, const ConfigVisitor::Describe& describe);

}  // namespace stageid
