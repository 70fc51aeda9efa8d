#pragma once

#include "tools/config/config_visitor.hpp"
#include "tools/config/yaml_document.hpp"

namespace stageid {

/// Fills a configuration from a document. Every key must be known, every required key must be present, and every value
/// must have its type and range.
/// @throws FormatErrors, each "FILE:LINE:COLUMN: problem; remedy".
void read_config(const YamlDocument& document, const ConfigVisitor::Describe& describe);

}  // namespace stageid
