#pragma once

#include <string>

namespace CLI {
class ParseError;
}

namespace stageid {

/// What CLI11 refused, as other messages are worded: "--band: got 1 value; expected at least 2".
std::string usage_problem(const CLI::ParseError& error);

}  // namespace stageid
