// A store of synthetic identifications: how fast it grows, how large it is, and how long queries and pages take.
//
//   fleet_study STORE.db STAGES DAYS MODES [PAGE.html PAGE_STAGES]
//
// 1 000 000 identifications with 20 modes: fleet_study /tmp/fleet.db 2740 365 20 /tmp/fleet.html 200

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <numbers>
#include <random>

#include "acquisition/files/fingerprint.hpp"
#include "acquisition/files/output_file.hpp"
#include "tools/fleet/fleet_page.hpp"
#include "tools/fleet/fleet_pairing.hpp"
#include "tools/fleet/fleet_store.hpp"

namespace stageid {
namespace {

using Clock = std::chrono::steady_clock;

template <typename Work>
double seconds_of(const Work& work) {
  const Clock::time_point start = Clock::now();
  work();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Of this process, for figures from a machine that others use too.
double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

Eigen::VectorXcd random_shape(std::mt19937_64& engine, Eigen::Index size) {
  std::normal_distribution<double> normal;
  return Eigen::VectorXcd::NullaryExpr(size, [&] { return normal(engine); }).normalized();
}

std::string date_of(int day) {
  const std::chrono::year_month_day date{
      std::chrono::sys_days{std::chrono::year{2026} / std::chrono::January / 1} +
      std::chrono::days{day}};
  return fmt::format("{:04}-{:02}-{:02}T06:00:00Z", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()));
}

/// A design of stages: modes with their shapes at 4 outputs and 4 inputs.
class Design {
 public:
  explicit Design(int modes) : engine_(1) {
    for (int m = 0; m < modes; ++m) {
      StoredMode mode;
      mode.frequency_hz = 60.0 * std::pow(1.07, m);
      mode.damping_ratio = 0.01;
      mode.damping_ratio_std = 1e-5;
      mode.modal_mass = 5.0;
      mode.output_shape = random_shape(engine_, 4);
      mode.input_shape = random_shape(engine_, 4);
      mode.shape_std = 0.02;
      modes_.push_back(mode);
    }
  }

  /// Stages differ by 0.5 %; modes drift by 1 % per year with the season, stage and mode.
  Identification identification(int stage, int day) {
    std::mt19937_64 of_stage(static_cast<std::uint64_t>(stage));
    std::normal_distribution<double> normal_of_stage;
    Identification out;
    out.job = fingerprint_of(fmt::format("{} {}", stage, day));
    out.stage = fmt::format("stage {:04}", stage);
    out.time_utc = date_of(day);
    out.log = fmt::format("/data/{:04}/{}.slog", stage, day);
    out.log_fingerprint = out.job;
    out.configuration = "{}";
    out.verdict = uniform_(engine_) < 0.005 ? IdentificationVerdict::not_trustworthy
                                            : IdentificationVerdict::trustworthy;
    if (out.verdict == IdentificationVerdict::not_trustworthy)
      out.reasons = "the residual is clearly larger than noise and known distortion";
    out.relative_rms_error = 0.01;
    out.results = "fleet_results";
    out.tags = {{"temperature", fmt::format("{:.1f}", 20.0 + normal_(engine_))}};
    out.outputs = {"s1", "s2", "s3", "s4"};
    out.inputs = {"a1", "a2", "a3", "a4"};
    for (StoredMode mode : modes_) {
      const double offset = 0.005 * normal_of_stage(of_stage);
      const double drift = 0.01 * normal_of_stage(of_stage) * day / 365.0;
      const double season = 1e-3 * std::sin(2.0 * std::numbers::pi * day / 365.0);
      const double std_hz = 1e-4 * mode.frequency_hz;
      mode.frequency_hz *= std::exp(offset + drift + season);
      mode.frequency_hz += std_hz * normal_(engine_);
      mode.frequency_std_hz = std_hz * std::exp(0.1 * normal_(engine_));
      if (uniform_(engine_) < 1e-4) mode.frequency_hz *= 1.005;
      if (uniform_(engine_) > 1e-3) out.modes.push_back(mode);
    }
    return out;
  }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
  std::vector<StoredMode> modes_;
};

void time_query(Database& database, const char* what, const std::string& sql) {
  std::size_t rows = 0;
  const double processor = processor_seconds();
  const double seconds = seconds_of([&] {
    const auto statement = database.prepare(sql);
    while (statement->step()) ++rows;
  });
  fmt::print("query {}: {} rows in {:.3f} s, {:.3f} s of processor time\n", what, rows, seconds,
             processor_seconds() - processor);
}

int study(int argc, char** argv) {
  if (argc != 5 && argc != 7) {
    fmt::print(stderr, "usage: fleet_study STORE STAGES DAYS MODES [PAGE.html PAGE_STAGES]\n");
    return 2;
  }
  const std::filesystem::path file = argv[1];
  const int stages = std::atoi(argv[2]);
  const int days = std::atoi(argv[3]);
  const bool made = std::filesystem::exists(file);
  FleetStore store(file, DatabaseAccess::create);
  if (!made) {
    Design design(std::atoi(argv[4]));
    const double all = static_cast<double>(stages) * days;
    double making = 0.0;
    double processor = processor_seconds();
    const double seconds = seconds_of([&] {
      // As they arrive: day by day.
      for (int day = 0; day < days; ++day)
        for (int stage = 0; stage < stages; ++stage) {
          Identification identification;
          making += seconds_of([&] { identification = design.identification(stage, day); });
          store.add(identification);
        }
    });
    fmt::print(
        "ingest: {:.0f} identifications in {:.1f} s, {:.0f} per second; {:.1f} s of processor time "
        "with their synthesis\n",
        all, seconds - making, all / (seconds - making), processor_seconds() - processor);
    processor = processor_seconds();
    const double pairing = seconds_of([&] { pair_fleet(store); });
    fmt::print("pairing: {:.1f} s, {:.0f} identifications per second, {:.1f} s of processor time\n",
               pairing, all / pairing, processor_seconds() - processor);
  }
  Database& database = store.database();
  double bytes = 0.0;
  if (is_database_url(file)) {
    const auto size = database.prepare(
        "SELECT SUM(pg_total_relation_size(oid)) FROM pg_class "
        "WHERE relnamespace = current_schema()::regnamespace AND relkind = 'r'");
    if (size->step()) bytes = size->number(0);
  } else {
    database.execute("PRAGMA wal_checkpoint(TRUNCATE)");
    bytes = static_cast<double>(std::filesystem::file_size(file));
  }
  fmt::print("size: {:.2f} GB, {:.0f} bytes per identification\n", bytes / 1e9,
             bytes / (static_cast<double>(stages) * days));
  time_query(database, "one stage's modes",
             "SELECT time_utc, mode, frequency_hz, frequency_std_hz FROM modes "
             "WHERE stage = 'stage 0007'");
  time_query(database, "modes of a stage in a month",
             "SELECT * FROM modes WHERE stage = 'stage 0007' AND time_utc >= '2026-03' AND "
             "time_utc < '2026-04'");
  time_query(database, "one mode on all stages",
             "SELECT stage, frequency_hz, deviation FROM stage_modes WHERE mode = 3");
  if (argc == 7) {
    FleetPageRequest request;
    request.output = argv[5];
    for (int stage = 0; stage < std::atoi(argv[6]); ++stage)
      request.stages.push_back(fmt::format("stage {:04}", stage));
    std::string page;
    const double processor = processor_seconds();
    const double seconds = seconds_of([&] { page = fleet_page(store, request); });
    write_text_file(request.output, page);
    fmt::print("page: {} stages, {:.2f} s, {:.2f} s of processor time, {:.2f} MB\n",
               request.stages.size(), seconds, processor_seconds() - processor,
               static_cast<double>(page.size()) / 1e6);
  }
  return 0;
}

}  // namespace
}  // namespace stageid

int main(int argc, char** argv) { return stageid::study(argc, argv); }
