#include "tools/fleet/watched_tracks.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <optional>

#include "acquisition/files/fail.hpp"
#include "estimation/tracking/tracked_parameters.hpp"
#include "tools/fleet/fleet_schema.hpp"
#include "tools/fleet/fleet_time.hpp"
#include "tools/watch/track_file.hpp"

namespace stageid {
namespace {

constexpr double kHour_s = 3600.0;
constexpr double kDay_s = 86400.0;

std::string utc_of(double days) {
  const auto seconds = std::chrono::seconds(std::llround(days * kDay_s));
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", std::chrono::sys_seconds(seconds));
}

double start_of(const WatchedLog& log, const WatchedTracks& tracks) {
  const std::optional<double> days =
      days_of(log.time_utc.empty() ? tracks.started_utc : log.time_utc);
  if (days) return *days;
  fail_request("{}: the time of its log is unknown; give --time 2026-05-04T12:34:56Z",
               log.file.string());
}

}  // namespace

std::size_t add_watched(FleetStore& store, const WatchedLog& log) {
  const WatchedTracks tracks = read_tracks(log.file, kHour_s);
  const double start = start_of(log, tracks);
  Database& database = store.database();
  Transaction transaction(database);
  database.create(watched_schema);
  database.prepare("INSERT INTO stage (name, changed) VALUES (?, 0) ON CONFLICT DO NOTHING")
      ->run(log.stage);
  const auto add = database.prepare(
      "INSERT INTO watched_property VALUES ((SELECT id FROM stage WHERE name = ?), ?, ?, ?, ?, ?, "
      "?) ON CONFLICT (stage_id, property, time_utc) DO UPDATE SET value = excluded.value, "
      "change = excluded.change, deviation = excluded.deviation");
  std::size_t rows = 0;
  for (std::size_t t = 0; t < tracks.time_s.size(); ++t)
    for (std::size_t p = 0; p < tracks.names.size(); ++p, ++rows) {
      const double change = tracks.change(t, p);
      const double nominal = tracks.nominal[p];
      const double value =
          tracks.kinds[p] == TrackedKind::delay ? nominal + change : nominal * (1.0 + change);
      add->run(log.stage, utc_of(start + tracks.time_s[t] / kDay_s), tracks.names[p],
               to_string(tracks.kinds[p]), value, change, tracks.deviation(t, p));
    }
  transaction.commit();
  return rows;
}

}  // namespace stageid
