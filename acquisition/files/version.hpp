#pragma once

#include <string_view>

namespace stageid {

/// Version of the program and its libraries, as "0.1.0".
std::string_view version() noexcept;

}  // namespace stageid
