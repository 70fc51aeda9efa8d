#include "estimation/modal/mode_tracks.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/modal/assignment.hpp"
#include "estimation/modal/modal_assurance.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

// h(x) = 24 means x = 482: a jump of 22 standard deviations at the same shape.
constexpr double kCostLimit = 24.0;
constexpr double kShapeWeight =
    4.0;  // 1 - MAC scatters less than a square: it sums over all channels
constexpr std::size_t kLeastCommon = 3;  // modes from which a common change is known
constexpr double kLeastStd = 1e-6;  // of a log-frequency; zero would make any difference infinite
constexpr std::size_t kPast = 7;
constexpr std::size_t kLeastPast = 3;

double heavy_tailed(double square) { return 5.0 * std::log1p(square / 4.0); }

double variance_of(const SeenMode& mode) {
  const double relative = mode.frequency_std_hz / mode.frequency_hz;
  return std::max(relative * relative, kLeastStd * kLeastStd);
}

}  // namespace

double ModeTracks::predicted_variance(const Track& track, double time) const {
  return track.variance + options_.drift * options_.drift * std::max(time - track.time, 0.0);
}

double ModeTracks::common_change(const std::vector<SeenMode>& modes, const Pairs& pairs) const {
  std::vector<double> changes;
  for (std::size_t m = 0; m < modes.size(); ++m)
    if (pairs[m])
      changes.push_back(std::log(modes[m].frequency_hz) - tracks_[*pairs[m]].log_frequency);
  return changes.size() < kLeastCommon ? 0.0 : median(changes);
}

Eigen::MatrixXd ModeTracks::costs(double time, const std::vector<SeenMode>& modes,
                                  double common) const {
  Eigen::MatrixXd cost(std::ssize(modes), std::ssize(tracks_));
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    const Track& track = tracks_[t];
    const double predicted = predicted_variance(track, time);
    for (std::size_t m = 0; m < modes.size(); ++m) {
      const SeenMode& mode = modes[m];
      const double difference = std::log(mode.frequency_hz) - common - track.log_frequency;
      const double variance = predicted + variance_of(mode);
      const double usual = options_.drift * options_.drift + variance_of(mode);
      double& entry = cost(static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(t));
      entry = heavy_tailed(difference * difference / variance) +
              std::max(std::log(variance / usual), 0.0);
      if (std::abs(difference) > kMostModeDifference) entry = kCostLimit;
      if (mode.shape.size() == 0 || mode.shape.size() != track.shape.size()) continue;
      const double mac = modal_assurance(track.shape, mode.shape)(0, 0);
      const double change = options_.shape_change * options_.shape_change;
      entry +=
          heavy_tailed(kShapeWeight * (1.0 - mac) / (change + mode.shape_std * mode.shape_std));
    }
  }
  return cost;
}

void ModeTracks::update(Track& track, double time, const SeenMode& mode) const {
  const double predicted = predicted_variance(track, time);
  const double gain = predicted / (predicted + variance_of(mode));
  track.log_frequency += gain * (std::log(mode.frequency_hz) - track.log_frequency);
  track.variance = (1.0 - gain) * predicted;
  track.time = time;
  track.count += 1.0;
  if (track.shape.size() != mode.shape.size()) {
    track.shape = mode.shape;
    return;
  }
  // Shapes are known up to a phase.
  const std::complex<double> product = mode.shape.dot(track.shape);
  const double length = std::abs(product);
  if (length == 0.0) return;
  track.shape += (mode.shape * (product / length) - track.shape) /
                 std::min(track.count, options_.shape_memory);
  track.shape.normalize();
}

std::vector<std::size_t> ModeTracks::add(double time, const std::vector<SeenMode>& modes) {
  Pairs paired = least_cost_pairs(costs(time, modes, 0.0), kCostLimit);
  paired = least_cost_pairs(costs(time, modes, common_change(modes, paired)), kCostLimit);
  std::vector<std::size_t> track_of;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    if (paired[m]) {
      track_of.push_back(static_cast<std::size_t>(*paired[m]));
      update(tracks_[track_of.back()], time, modes[m]);
    } else {
      track_of.push_back(tracks_.size());
      tracks_.push_back(
          {time, std::log(modes[m].frequency_hz), variance_of(modes[m]), 1.0, modes[m].shape});
    }
  }
  return track_of;
}

SeenMode ModeTracks::mode(std::size_t track) const {
  const Track& t = tracks_.at(track);
  const double frequency_hz = std::exp(t.log_frequency);
  return {frequency_hz, frequency_hz * std::sqrt(t.variance), t.shape, 0.0};
}

std::vector<double> deviations_from_past(const std::vector<double>& values,
                                         const std::vector<double>& deviation) {
  std::vector<double> out(values.size(), 0.0);
  std::vector<double> sizes;
  for (std::size_t i = kLeastPast; i < values.size(); ++i) {
    const std::size_t first = i - std::min(i, kPast);
    std::vector<double> past(values.begin() + first, values.begin() + i);
    out[i] = values[i] - median(past);
    sizes.push_back(std::abs(out[i]));
  }
  if (sizes.empty()) return out;
  const double usual = 1.4826 * median(sizes);
  for (std::size_t i = kLeastPast; i < values.size(); ++i) {
    const double scale = std::hypot(usual, deviation[i]);
    out[i] = scale > 0.0 ? out[i] / scale : 0.0;
  }
  return out;
}

}  // namespace stageid
