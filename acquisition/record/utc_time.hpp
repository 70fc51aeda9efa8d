#pragma once

#include <string>

namespace stageid {

/// The current time as ISO 8601 in UTC, "2026-05-04T12:34:56Z".
std::string utc_now();
/// The same with milliseconds, "2026-05-04T12:34:56.789Z".
std::string utc_now_ms();

}  // namespace stageid
