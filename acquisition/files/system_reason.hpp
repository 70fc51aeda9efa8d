#pragma once

#include <string>

namespace stageid {

/// The operating system's reason with a remedy: "No space left on device; free some space, or write
/// elsewhere". Unchanged if no remedy is known.
std::string with_remedy(const std::string& reason);

/// The same for an errno.
std::string system_reason(int error);

}  // namespace stageid
