#pragma once

#include <string_view>

namespace stageid {

inline constexpr int kFleetSchemaVersion = 1;

// The tables of a store, from the .sql files of this folder.
extern const std::string_view fleet_schema;
extern const std::string_view watched_schema;

}  // namespace stageid
