#pragma once

#include <optional>
#include <string>

namespace stageid {

/// Days since 1970 from ISO 8601 in UTC, "2026-05-04T12:34:56Z" or only its date; empty for other texts, because
/// the store sorts times as texts.
std::optional<double> days_of(const std::string& time_utc);

}  // namespace stageid
