#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/fleet/fleet_store.hpp"

namespace stageid {

/// What a page of a fleet shows.
struct FleetPageRequest {
  std::vector<std::string> stages;  ///< empty: all
  std::string since;                ///< ISO 8601, empty: from the first
  std::string until;                ///< not included; empty: to the last
  std::filesystem::path output;     ///< reports are linked relative to its folder
};

/// The page of a fleet as HTML: self-contained, except for the links to the reports.
/// @throws std::invalid_argument for an unknown stage, or more than kMostOnPage identifications
std::string fleet_page(const FleetStore& store, const FleetPageRequest& request);

inline constexpr std::size_t kMostOnPage = 100000;

}  // namespace stageid
