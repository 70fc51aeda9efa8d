#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/support/process/temporary_directory.hpp"
#include "tools/fleet/fleet_store.hpp"

namespace stageid::test {

/// A trustworthy result with 2 outputs and 3 inputs, and a tag. Mode number i has the i-th of a few shapes.
Identification identification(const std::string& job, const std::string& stage,
                              const std::string& time_utc, const std::vector<double>& frequency_hz);

/// Where a test has its store: the file NAME.db in its folder or, if the environment has the URL of a PostgreSQL
/// database in STAGEID_TEST_POSTGRES, a schema of its own in that database.
std::filesystem::path store_place(const TemporaryDirectory& folder,
                                  const std::string& name = "fleet");
bool stores_are_files();

std::int64_t count_in(const FleetStore& store, const std::string& table);

}  // namespace stageid::test
