#include "tests/tools/fleet/fleet_fixture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

namespace stageid::test {

Identification identification(const std::string& job, const std::string& stage,
                              const std::string& time_utc,
                              const std::vector<double>& frequency_hz) {
  Identification out;
  out.job = job;
  out.stage = stage;
  out.time_utc = time_utc;
  out.log = "/data/" + job;
  out.log_fingerprint = job;
  out.configuration = "{}";
  out.verdict = IdentificationVerdict::trustworthy;
  out.outputs = {"s1", "s2"};
  out.inputs = {"a1", "a2", "a3"};
  out.tags = {{"temperature", "21.5"}};
  for (const double hz : frequency_hz) {
    StoredMode mode;
    mode.frequency_hz = hz;
    mode.frequency_std_hz = 1e-4 * hz;
    mode.damping_ratio = 0.01;
    const auto i = static_cast<double>(out.modes.size());
    mode.output_shape = Eigen::Vector2cd(std::cos(i), std::sin(i));
    mode.input_shape = Eigen::Vector3cd(std::sin(2.0 * i), std::cos(i), 1.0).normalized();
    out.modes.push_back(mode);
  }
  return out;
}

bool stores_are_files() { return std::getenv("STAGEID_TEST_POSTGRES") == nullptr; }

std::filesystem::path store_place(const TemporaryDirectory& folder, const std::string& name) {
  if (stores_are_files()) return folder / (name + ".db");
  const std::string database = std::getenv("STAGEID_TEST_POSTGRES");
  std::string schema = folder.path().filename().string() + "_" + name;
  std::replace(schema.begin(), schema.end(), '-', '_');
  open_database(database, DatabaseAccess::create)
      ->execute(fmt::format("CREATE SCHEMA IF NOT EXISTS \"{}\"", schema));
  return fmt::format("{}{}options=-csearch_path%3D%22{}%22", database,
                     database.find('?') == std::string::npos ? '?' : '&', schema);
}

std::int64_t count_in(const FleetStore& store, const std::string& table) {
  const auto count = store.database().prepare("SELECT COUNT(*) FROM " + table);
  count->step();
  return count->integer(0);
}

}  // namespace stageid::test
