#include "tools/fleet/fleet_pairing.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>

#include "acquisition/files/fail.hpp"
#include "estimation/modal/mode_tracks.hpp"
#include "frf/statistics/order_statistic.hpp"
#include "tools/fleet/fleet_time.hpp"

namespace stageid {
namespace {

constexpr double kFar = 6.0;           // standard deviations of an outlier
constexpr double kUsualShare = 0.8;    // share of the days from which a mode should not be missing
constexpr double kLeastShare = 0.2;    // share of the days from which a mode has a number
constexpr double kStageSpread = 0.01;  // of a frequency between stages, relative
constexpr std::size_t kLeastStages = 5;

struct Row {
  std::int64_t identification = 0;
  std::int64_t number = 0;
  std::size_t day = 0;  ///< index of the identification
  double damping_ratio = 0.0;
  std::size_t track = 0;
  double deviation = 0.0;
  SeenMode mode;
};

/// The identifications of a stage by time, and their modes.
struct StageHistory {
  std::vector<std::int64_t> identifications;
  std::vector<double> days;
  std::vector<Row> rows;
};

std::size_t names_in(const std::string& list) {
  return static_cast<std::size_t>(std::ranges::count(list, ',')) + 1;
}

/// A damaged store may contain anything.
double positive_number(const Statement& row, int column, const Database& database) {
  const double number = row.number(column);
  if (!std::isfinite(number) || number <= 0.0)
    fail_format(database.name(), "", "contains the frequency {} Hz; restore a copy", number);
  return number;
}

StageHistory read_stage(Database& database, std::int64_t stage) {
  StageHistory history;
  const auto rows = database.prepare(
      "SELECT i.id, i.time_utc, m.number, m.frequency_hz, m.frequency_std_hz, m.damping_ratio, "
      "m.shape_std, m.shape, c.outputs "
      "FROM identification i JOIN channels c ON c.id = i.channels_id "
      "LEFT JOIN mode m ON m.identification_id = i.id "
      "WHERE i.stage_id = ? AND i.is_current = 1 ORDER BY i.time_utc, i.job, m.number");
  rows->bind(stage);
  while (rows->step()) {
    if (history.identifications.empty() || history.identifications.back() != rows->integer(0)) {
      history.identifications.push_back(rows->integer(0));
      history.days.push_back(days_of(rows->text(1)).value_or(0.0));
    }
    if (rows->is_null(2)) continue;
    Row row;
    row.identification = rows->integer(0);
    row.number = rows->integer(2);
    row.day = history.days.size() - 1;
    row.damping_ratio = rows->number(5);
    row.mode = {positive_number(*rows, 3, database), rows->number(4),
                residue_shape(rows->bytes(7), names_in(rows->text(8))), rows->number(6)};
    history.rows.push_back(std::move(row));
  }
  return history;
}

/// @returns the tracks
ModeTracks follow(StageHistory& history) {
  ModeTracks tracks;
  std::size_t first = 0;
  for (std::size_t day = 0; day < history.days.size(); ++day) {
    std::size_t end = first;
    std::vector<SeenMode> modes;
    for (; end < history.rows.size() && history.rows[end].day == day; ++end)
      modes.push_back(history.rows[end].mode);
    const std::vector<std::size_t> found = tracks.add(history.days[day], modes);
    for (std::size_t i = 0; i < found.size(); ++i) history.rows[first + i].track = found[i];
    first = end;
  }
  return tracks;
}

/// The rows of each track, in order of time.
std::vector<std::vector<Row*>> by_track(StageHistory& history, std::size_t tracks) {
  std::vector<std::vector<Row*>> rows(tracks);
  for (Row& row : history.rows) rows[row.track].push_back(&row);
  return rows;
}

/// Per identification, what is unusual about its modes.
std::vector<std::vector<std::string>> unusual(const StageHistory& history,
                                              const std::vector<std::vector<Row*>>& tracks) {
  std::vector<std::vector<std::string>> reasons(history.days.size());
  for (const std::vector<Row*>& rows : tracks) {
    std::vector<double> values;
    std::vector<double> deviation;
    for (const Row* row : rows) {
      values.push_back(std::log(row->mode.frequency_hz));
      deviation.push_back(row->mode.frequency_std_hz / row->mode.frequency_hz);
    }
    const std::vector<double> far = deviations_from_past(values, deviation);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      rows[i]->deviation = far[i];
      if (std::abs(far[i]) > kFar)
        reasons[rows[i]->day].push_back(
            fmt::format("{:.5g} Hz: {:+.1f} standard deviations from the past",
                        rows[i]->mode.frequency_hz, far[i]));
    }
    const std::size_t begin = rows.front()->day;
    const auto days = static_cast<double>(history.days.size() - begin);
    if (static_cast<double>(rows.size()) < kUsualShare * days) continue;
    auto next = rows.begin();
    for (std::size_t day = begin; day < history.days.size(); ++day) {
      if (next != rows.end() && (*next)->day == day)
        ++next;
      else
        reasons[day].push_back(
            fmt::format("{:.5g} Hz: the mode is missing", (*std::prev(next))->mode.frequency_hz));
    }
  }
  return reasons;
}

double median_of(const std::vector<Row*>& rows, double (*value)(const Row&)) {
  std::vector<double> values;
  for (const Row* row : rows) values.push_back(value(*row));
  return median(values);
}

std::vector<std::complex<float>> floats_of(const Eigen::VectorXcd& shape) {
  const Eigen::VectorXcf floats = shape.cast<std::complex<float>>();
  return {floats.begin(), floats.end()};
}

void store_stage(Database& database, std::int64_t stage, const StageHistory& history,
                 const ModeTracks& tracks, const std::vector<std::vector<Row*>>& rows,
                 const std::vector<std::vector<std::string>>& reasons) {
  const auto mode = database.prepare(
      "UPDATE mode SET track = ?, deviation = ? WHERE identification_id = ? AND number = ?");
  for (const Row& row : history.rows)
    mode->run(row.track, row.deviation, row.identification, row.number);
  const auto outlier = database.prepare("UPDATE identification SET outlier = ? WHERE id = ?");
  for (std::size_t i = 0; i < reasons.size(); ++i)
    outlier->run(reasons[i].empty() ? std::optional<std::string>()
                                    : fmt::format("{}", fmt::join(reasons[i], "; ")),
                 history.identifications[i]);
  database.prepare("DELETE FROM track WHERE stage_id = ?")->run(stage);
  const auto track = database.prepare(
      "INSERT INTO track (stage_id, track, seen, frequency_hz, frequency_std_hz, damping_ratio, "
      "shape) VALUES (?, ?, ?, ?, ?, ?, ?)");
  for (std::size_t t = 0; t < rows.size(); ++t) {
    const double hz = median_of(rows[t], [](const Row& row) { return row.mode.frequency_hz; });
    double square = 0.0;
    for (const Row* row : rows[t]) square += std::pow(row->mode.frequency_hz - hz, 2);
    track->run(stage, t, rows[t].size(), hz,
               std::sqrt(square / static_cast<double>(rows[t].size())),
               median_of(rows[t], [](const Row& row) { return row.damping_ratio; }),
               floats_of(tracks.mode(t).shape));
  }
  database.prepare("UPDATE stage SET changed = 2 WHERE id = ?")->run(stage);
}

struct StageTrack {
  std::int64_t stage = 0;
  std::int64_t track = 0;
  std::size_t mode = 0;
  SeenMode seen;
};

std::vector<StageTrack> read_tracks(Database& database) {
  std::vector<StageTrack> out;
  const auto rows = database.prepare(
      "SELECT t.stage_id, t.track, t.frequency_hz, t.shape FROM track t "
      "JOIN stage s ON s.id = t.stage_id "
      "WHERE t.seen >= CAST(? AS DOUBLE PRECISION) * (SELECT COUNT(*) FROM identification i WHERE "
      "i.stage_id = t.stage_id "
      "AND i.is_current = 1 AND i.channels_id IS NOT NULL) ORDER BY s.name, t.track");
  rows->bind(kLeastShare);
  while (rows->step()) {
    const double hz = positive_number(*rows, 2, database);
    out.push_back({rows->integer(0),
                   rows->integer(1),
                   0,
                   {hz, kStageSpread * hz, shape_in(rows->bytes(3)), 0.0}});
  }
  return out;
}

/// Stages are paired one after another, as days are, but without drift.
void pair_stages(Database& database) {
  std::vector<StageTrack> all = read_tracks(database);
  ModeTracks modes({.drift = 0.0, .shape_change = 0.2, .shape_memory = 1e9});
  for (std::size_t first = 0; first < all.size();) {
    std::size_t end = first;
    std::vector<SeenMode> seen;
    for (; end < all.size() && all[end].stage == all[first].stage; ++end)
      seen.push_back(all[end].seen);
    const std::vector<std::size_t> found = modes.add(0.0, seen);
    for (std::size_t i = 0; i < found.size(); ++i) all[first + i].mode = found[i];
    first = end;
  }
  std::vector<std::vector<double>> values(modes.size());
  for (const StageTrack& track : all)
    values[track.mode].push_back(std::log(track.seen.frequency_hz));
  // Numbers by frequency.
  std::vector<std::size_t> order(modes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t m) { return modes.mode(m).frequency_hz; });
  std::vector<std::size_t> number(modes.size());
  for (std::size_t i = 0; i < order.size(); ++i) number[order[i]] = i + 1;

  const auto store =
      database.prepare("UPDATE track SET mode = ?, deviation = ? WHERE stage_id = ? AND track = ?");
  for (const StageTrack& track : all) {
    std::vector<double> others = values[track.mode];
    std::optional<double> deviation;
    if (others.size() >= kLeastStages) {
      const double centre = median(others);
      for (double& value : others) value = std::abs(value - centre);
      const double spread = 1.4826 * median(others);
      if (spread > 0.0) deviation = (std::log(track.seen.frequency_hz) - centre) / spread;
    }
    store->run(number[track.mode], deviation, track.stage, track.track);
  }
}

}  // namespace

void pair_fleet(FleetStore& store) {
  Database& database = store.database();
  std::vector<std::int64_t> changed;
  const auto stages = database.prepare("SELECT id FROM stage WHERE changed = 1 ORDER BY id");
  while (stages->step()) changed.push_back(stages->integer(0));
  for (const std::int64_t stage : changed) {
    Transaction transaction(database);
    // Other processes may have paired it meanwhile.
    if (!database.prepare("SELECT 1 FROM stage WHERE id = ? AND changed = 1")->first(stage))
      continue;
    StageHistory history = read_stage(database, stage);
    const ModeTracks tracks = follow(history);
    const std::vector<std::vector<Row*>> rows = by_track(history, tracks.size());
    store_stage(database, stage, history, tracks, rows, unusual(history, rows));
    transaction.commit();
  }
  // 2: followed over time, but not yet compared with the other stages, even if an earlier call was interrupted.
  const auto is_paired = [&] {
    return !database.prepare("SELECT 1 FROM stage WHERE changed = 2")->first().has_value();
  };
  if (is_paired()) return;
  Transaction transaction(database);
  if (is_paired()) return;
  pair_stages(database);
  database.execute("UPDATE stage SET changed = 0 WHERE changed = 2");
  transaction.commit();
}

}  // namespace stageid
