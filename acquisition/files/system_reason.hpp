#pragma once

#include <string>

namespace stageid {

/// A reason in the operating system's words and what to do about it: "No space left on device; free some
/// space, or write elsewhere". As it is where nothing is known to do.
std::string with_remedy(const std::string& reason);

/// The same of an errno.
std::string system_reason(int error);

}  // namespace stageid
