#include "tools/fleet/fleet_store.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <complex>
#include <cstring>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/input_files.hpp"
#include "acquisition/files/version.hpp"
#include "tools/fleet/fleet_schema.hpp"
#include "tools/terminal/text_lines.hpp"

namespace stageid {
namespace {

constexpr const char* kStoreFormat = "stageid-fleet-store";

/// The number of a JobState.
constexpr const char* kState =
    "CASE WHEN verdict = 'failed' THEN 1 WHEN is_current = 0 THEN 2 ELSE 3 END";

using ComplexFloat = std::complex<float>;

std::vector<ComplexFloat> shape_floats(const StoredMode& mode) {
  std::vector<ComplexFloat> shape;
  for (const Eigen::VectorXcd* part : {&mode.output_shape, &mode.input_shape})
    for (const std::complex<double>& entry : *part) shape.emplace_back(entry);
  return shape;
}

std::optional<std::string> filled(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional(text);
}

void create_tables(Database& database) {
  if (!database.tables().empty()) return;  // without waiting for other writers
  Transaction transaction(database);
  if (database.tables().empty()) {
    database.create(fleet_schema);
    database.prepare("INSERT INTO store VALUES (?, ?)")
        ->run(std::string(kStoreFormat), kFleetSchemaVersion);
  }
  transaction.commit();
}

void require_store(Database& database) {
  const FormatError none(database.name(), "",
                         "is not a store of 'stageid fleet'; choose another one");
  if (std::ranges::count(database.tables(), "store") == 0) throw none;
  const auto store = database.prepare("SELECT format, schema_version FROM store");
  if (!store->step() || store->text(0) != kStoreFormat) throw none;
  if (store->integer(1) != kFleetSchemaVersion)
    fail_format(database.name(), "", "has schema version {}; this program supports version {}",
                store->integer(1), kFleetSchemaVersion);
}

}  // namespace

FleetStore::FleetStore(const std::filesystem::path& place, DatabaseAccess access)
    : database_(open_database(place, access)) {
  if (!is_database_url(place)) note_own_file(place);
  if (access == DatabaseAccess::create) create_tables(*database_);
  require_store(*database_);
  state_ = database_->prepare(fmt::format("SELECT {} FROM identification WHERE job = ?", kState));
  add_stage_ = database_->prepare(
      "INSERT INTO stage (name, changed) VALUES (?, 1) ON CONFLICT (name) DO UPDATE SET changed = "
      "1");
  add_configuration_ =
      database_->prepare("INSERT INTO configuration (text) VALUES (?) ON CONFLICT DO NOTHING");
  add_channels_ = database_->prepare(
      "INSERT INTO channels (outputs, inputs) VALUES (?, ?) ON CONFLICT DO NOTHING");
  add_identification_ = database_->prepare(
      "INSERT INTO identification (is_current, job, stage_id, time_utc, verdict, reasons, "
      "relative_rms_error, health, log, log_fingerprint, version, configuration_id, channels_id, "
      "results) VALUES (1, ?, (SELECT id FROM stage WHERE name = ?), ?, ?, ?, ?, ?, ?, ?, ?, "
      "(SELECT id FROM configuration WHERE text = ?), "
      "(SELECT id FROM channels WHERE outputs = ? AND inputs = ?), ?) RETURNING id");
  add_mode_ = database_->prepare(
      "INSERT INTO mode (identification_id, number, frequency_hz, frequency_std_hz, "
      "damping_ratio, damping_ratio_std, modal_mass, shape_std, shape) "
      "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)");
  add_tag_ = database_->prepare("INSERT INTO tag VALUES (?, ?, ?, ?)");
  const std::string failed = "verdict = 'failed' AND (job = ? OR log = ?)";
  remove_failed_ = database_->prepare("DELETE FROM identification WHERE " + failed);
  remove_tags_ = database_->prepare(
      "DELETE FROM tag WHERE identification_id IN (SELECT id FROM identification WHERE " + failed +
      ")");
  const std::string of_log = "log_fingerprint = ? AND is_current = 1 AND verdict <> 'failed'";
  supersede_ = database_->prepare("UPDATE identification SET is_current = 0 WHERE " + of_log);
  change_stages_ = database_->prepare(
      "UPDATE stage SET changed = 1 WHERE id IN (SELECT stage_id FROM identification WHERE " +
      of_log + ")");
}

std::map<std::string, JobState> FleetStore::jobs() const {
  std::map<std::string, JobState> jobs;
  const auto rows = database_->prepare(fmt::format("SELECT job, {} FROM identification", kState));
  while (rows->step()) jobs[rows->text(0)] = static_cast<JobState>(rows->integer(1));
  return jobs;
}

JobState FleetStore::state_of(const std::string& job) {
  return static_cast<JobState>(state_->first(job).value_or(0));
}

void FleetStore::supersede(const std::string& log_fingerprint) {
  change_stages_->run(log_fingerprint);
  supersede_->run(log_fingerprint);
}

void FleetStore::make_current(const std::string& job) {
  Transaction transaction(*database_);
  const auto found = database_->prepare("SELECT log_fingerprint FROM identification WHERE job = ?");
  if (found->bind(job).step()) supersede(found->text(0));
  database_->prepare("UPDATE identification SET is_current = 1 WHERE job = ?")->run(job);
  transaction.commit();
}

std::optional<std::int64_t> FleetStore::failure(const std::string& job) const {
  return database_->prepare("SELECT id FROM identification WHERE job = ? AND verdict = 'failed'")
      ->first(job);
}

bool FleetStore::add(const Identification& result) {
  Transaction transaction(*database_);
  if (is_done(state_of(result.job))) return false;
  const bool failed = result.verdict == IdentificationVerdict::failed;
  const std::string outputs = fmt::format("{}", fmt::join(result.outputs, ","));
  const std::string inputs = fmt::format("{}", fmt::join(result.inputs, ","));
  remove_tags_->run(result.job, result.log.string());
  remove_failed_->run(result.job, result.log.string());
  if (!failed) supersede(result.log_fingerprint);
  add_stage_->run(result.stage);
  add_configuration_->run(result.configuration);
  if (!failed) add_channels_->run(outputs, inputs);
  const std::int64_t id =
      add_identification_
          ->first(result.job, result.stage, result.time_utc, to_string(result.verdict),
                  filled(result.reasons), result.relative_rms_error, filled(result.health_json),
                  result.log.string(), result.log_fingerprint, std::string(version()),
                  result.configuration, outputs, inputs, filled(result.results))
          .value();
  std::size_t number = 0;
  for (const StoredMode& mode : result.modes)
    add_mode_->run(id, ++number, mode.frequency_hz, mode.frequency_std_hz, mode.damping_ratio,
                   mode.damping_ratio_std, mode.modal_mass, mode.shape_std, shape_floats(mode));
  for (const auto& [name, text] : result.tags) add_tag_->run(id, name, text, parse_number(text));
  transaction.commit();
  return true;
}

std::optional<std::string> FleetStore::log_fingerprint(const std::filesystem::path& log,
                                                       std::int64_t size, std::int64_t changed_ns) {
  const auto known = database_->prepare(
      "SELECT fingerprint FROM log_file WHERE path = ? AND size = ? AND changed_ns = ?");
  if (!known->bind(log.string(), size, changed_ns).step()) return std::nullopt;
  return known->text(0);
}

void FleetStore::note_log(const std::filesystem::path& log, std::int64_t size,
                          std::int64_t changed_ns, const std::string& fingerprint) {
  database_
      ->prepare(
          "INSERT INTO log_file VALUES (?, ?, ?, ?) ON CONFLICT (path) DO UPDATE SET "
          "size = excluded.size, changed_ns = excluded.changed_ns, "
          "fingerprint = excluded.fingerprint")
      ->run(log.string(), size, changed_ns, fingerprint);
}

Eigen::VectorXcd shape_in(std::span<const std::byte> blob) {
  std::vector<ComplexFloat> floats(blob.size() / sizeof(ComplexFloat));
  if (floats.empty()) return {};
  std::memcpy(floats.data(), blob.data(), floats.size() * sizeof(ComplexFloat));
  return Eigen::Map<const Eigen::VectorXcf>(floats.data(), std::ssize(floats))
      .cast<std::complex<double>>();
}

Eigen::VectorXcd residue_shape(std::span<const std::byte> blob, std::size_t outputs) {
  const Eigen::VectorXcd shape = shape_in(blob);
  const auto rows = static_cast<Eigen::Index>(outputs);
  if (shape.size() <= rows) return {};
  const Eigen::MatrixXcd residue = shape.head(rows) * shape.tail(shape.size() - rows).transpose();
  return residue.reshaped();
}

}  // namespace stageid
