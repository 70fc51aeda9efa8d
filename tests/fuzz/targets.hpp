#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace stageid::fuzz {

using Bytes = std::span<const std::uint8_t>;

/// A reader of bytes from outside. Errors that it is allowed to report are caught here; anything else is a finding.
struct Target {
  std::string_view name;
  void (*read)(Bytes bytes);
};

/// @throws std::invalid_argument with the known names
const Target& target(std::string_view name);

/// One input; the errors of a reader are expected.
void run(const Target& target, Bytes bytes);

}  // namespace stageid::fuzz
