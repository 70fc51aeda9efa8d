#include "tools/dashboard/live_levels.hpp"

#include <cmath>

namespace stageid {

LiveLevels::Sums::Sums(Eigen::Index channels)
    : peak(Eigen::ArrayXd::Zero(channels)), squares(Eigen::ArrayXd::Zero(channels)) {}

void LiveLevels::Sums::add(const Sums& other) {
  peak = peak.max(other.peak);
  squares += other.squares;
  rows += other.rows;
}

void LiveLevels::Sums::clear() {
  peak.setZero();
  squares.setZero();
  rows = 0;
}

LiveLevels::LiveLevels(Eigen::Index channels)
    : gathered_(channels), handed_over_(channels), largest_(Eigen::ArrayXd::Zero(channels)) {}

void LiveLevels::rows(std::span<const double> rows, std::size_t words) noexcept {
  const Eigen::Index channels = gathered_.peak.size();
  for (std::size_t at = 0; at + words <= rows.size(); at += words) {
    const Eigen::Map<const Eigen::ArrayXd> row(rows.data() + at, channels);
    gathered_.peak = gathered_.peak.max(row.abs());
    gathered_.squares += row.square();
    ++gathered_.rows;
  }
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock) return;
  handed_over_.add(gathered_);
  largest_ = largest_.max(gathered_.peak);
  gathered_.clear();
}

void LiveLevels::end_run(const LogRun& run) noexcept {
  const std::lock_guard lock(ended_mutex_);  // once per run, during a copy
  ended_.health += run.health;
  ended_.timing += run.timing;
  ++ended_.runs;
  ended_.last = run;
}

Levels LiveLevels::take() {
  const std::lock_guard lock(mutex_);
  Levels levels;
  levels.peak = handed_over_.peak;
  levels.rows = handed_over_.rows;
  levels.rms = Eigen::ArrayXd::Zero(levels.peak.size());
  if (levels.rows > 0)
    levels.rms = (handed_over_.squares / static_cast<double>(levels.rows)).sqrt();
  levels.largest_peak = largest_;
  handed_over_.clear();
  return levels;
}

LiveLevels::Ended LiveLevels::ended() const {
  const std::lock_guard lock(ended_mutex_);
  return ended_;
}

}  // namespace stageid
