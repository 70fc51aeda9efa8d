#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/fleet/fleet_store.hpp"

namespace stageid::test {

/// A trustworthy result with 2 outputs and 3 inputs, and a tag. Mode number i has the i-th of a few shapes.
Identification identification(const std::string& job, const std::string& stage,
                              const std::string& time_utc, const std::vector<double>& frequency_hz);

std::int64_t count_in(const FleetStore& store, const std::string& table);

}  // namespace stageid::test
