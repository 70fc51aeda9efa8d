#pragma once

#include <cstdint>
#include <string>

#include "tools/config/config_visitor.hpp"

namespace stageid {

bool in_range(double value, const NumberRule& rule);

// The rules as text, for errors and for the schema: "> 0 s", "0 ... 0.5", "at least 1", "3 entries".
std::string describe_range(const NumberRule& rule);
std::string describe_range(std::int64_t low, std::int64_t high);
std::string describe_count(CountRule count);
std::string describe_forms(const FlexibleRule& rule);

}  // namespace stageid
