#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "excitation/words/words.hpp"
#include "tools/database/database.hpp"

namespace stageid {

/// One mode in the store. Both shapes have norm one.
struct StoredMode {
  double frequency_hz = 0.0;
  std::optional<double> frequency_std_hz;
  double damping_ratio = 0.0;
  std::optional<double> damping_ratio_std;
  double modal_mass = 0.0;
  Eigen::VectorXcd output_shape;
  Eigen::VectorXcd input_shape;
  std::optional<double> shape_std;  ///< root of the sum of the variances of both shapes
};

enum class IdentificationVerdict : std::uint8_t { trustworthy, not_trustworthy, failed };
template <>
inline constexpr std::array kWords<IdentificationVerdict> = {"trustworthy", "not trustworthy",
                                                             "failed"};

/// The result of one job. A failed one has neither channels nor modes.
struct Identification {
  std::string job;  ///< see job_id()
  std::string stage;
  std::string time_utc;  ///< ISO 8601
  std::filesystem::path log;
  std::string log_fingerprint;
  std::string configuration;  ///< canonical text of the group `identification`
  IdentificationVerdict verdict = IdentificationVerdict::failed;
  std::string reasons;
  std::string health_json;  ///< findings
  std::optional<double> relative_rms_error;
  std::string results;  ///< folder with the job's files, relative to that of the store
  std::vector<std::pair<std::string, std::string>> tags;
  std::vector<std::string> outputs;
  std::vector<std::string> inputs;
  std::vector<StoredMode> modes;
};

/// What a store knows of a job; superseded: another result of its log is shown.
enum class JobState : std::uint8_t { none, failed, superseded, current };
inline bool is_done(JobState state) {
  return state == JobState::superseded || state == JobState::current;
}

/// The database of a fleet, docs/formats.md. Each function that writes is one transaction.
class FleetStore {
 public:
  /// @param place a file, or the URL of a PostgreSQL database
  /// @param access create: also the file and the tables @throws FileError, FormatError
  FleetStore(const std::filesystem::path& place, DatabaseAccess access);
  FleetStore(FleetStore&&) = delete;

  Database& database() const noexcept { return *database_; }
  std::map<std::string, JobState> jobs() const;
  JobState state_of(const std::string& job);
  /// The number of a failed result, which mostly differs from that of the failure before it.
  std::optional<std::int64_t> failure(const std::string& job) const;
  /// Does nothing if the job is done; replaces a failed one of the same job or log. @returns whether it was added
  /// A result becomes the current one of its log: others, of other options or versions, are kept, but not shown.
  bool add(const Identification& identification);
  /// Makes the result of a job the current one of its log again.
  void make_current(const std::string& job);

  /// The fingerprint of a log of this size and time of change, if it was computed before.
  std::optional<std::string> log_fingerprint(const std::filesystem::path& log, std::int64_t size,
                                             std::int64_t changed_ns);
  void note_log(const std::filesystem::path& log, std::int64_t size, std::int64_t changed_ns,
                const std::string& fingerprint);

 private:
  /// Results of this log are no longer current, and their stages have to be paired again.
  void supersede(const std::string& log_fingerprint);

  std::unique_ptr<Database> database_;
  // Empty until the tables exist.
  std::unique_ptr<Statement> state_, add_stage_, add_configuration_, add_channels_,
      add_identification_, add_mode_, add_tag_, remove_failed_, remove_tags_, supersede_,
      change_stages_;
};

/// The numbers of a column `shape`: float32 pairs (re, im).
Eigen::VectorXcd shape_in(std::span<const std::byte> blob);

/// vec(output_shape input_shape^T) from the column mode.shape: outputs, then inputs.
Eigen::VectorXcd residue_shape(std::span<const std::byte> blob, std::size_t outputs);

}  // namespace stageid
