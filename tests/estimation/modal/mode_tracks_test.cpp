#include "estimation/modal/mode_tracks.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

namespace stageid::test_mode_tracks {

constexpr Eigen::Index kChannels = 12;  // 4 outputs x 3 inputs
constexpr int kDays = 365;

Eigen::VectorXcd random_shape(std::mt19937_64& engine) {
  std::normal_distribution<double> normal;
  const Eigen::VectorXcd output = Eigen::VectorXcd::NullaryExpr(4, [&] { return normal(engine); });
  const Eigen::VectorXcd input = Eigen::VectorXcd::NullaryExpr(3, [&] { return normal(engine); });
  const Eigen::MatrixXcd residue = output * input.transpose();
  return residue.reshaped().normalized();
}

/// What makes pairing difficult.
struct Scene {
  double shape_std = 0.1;
  double temperature =
      5e-4;            ///< relative change of all frequencies, standard deviation from day to day
  double walk = 2e-4;  ///< relative change of each frequency per day
  int gap_days = 21;
};

/// A stage whose modes drift over a year, with the season, with the temperature of the day, and at random. Of each
/// pair of neighbours, one rises and one falls, so that they cross; modes are missed, some are spurious, whole days
/// are missing, once for three weeks, and one mode jumps by 1 % after a repair.
struct Year {
  Year(int modes, std::uint64_t seed, const Scene& scene = {}) : scene_(scene), engine_(seed) {
    for (int m = 0; m < modes; ++m) {
      hz_.push_back(60.0 * std::pow(1.13, m / 2) * (m % 2 == 0 ? 1.0 : 1.012));
      trend_.push_back((m % 2 == 0 ? 0.02 : -0.012) / kDays);
      shape_.push_back(random_shape(engine_));
    }
    walk_.resize(hz_.size(), 0.0);
  }

  struct Day {
    std::vector<SeenMode> modes;
    std::vector<int> truth;  ///< -1: spurious
  };

  Day day(int t) {
    const double temperature = scene_.temperature * normal_(engine_);
    Day out;
    for (std::size_t m = 0; m < hz_.size(); ++m) {
      walk_[m] += scene_.walk * normal_(engine_);
      if (m == 4 && t == 200) walk_[m] += 0.01;
      if (uniform_(engine_) < 0.03) continue;
      const double season = 2e-3 * std::sin(2.0 * std::numbers::pi * t / kDays);
      const double log_change = trend_[m] * t + season + walk_[m] + temperature;
      const double std_hz = 1e-4 * hz_[m];
      out.modes.push_back(
          seen(hz_[m] * std::exp(log_change) + std_hz * normal_(engine_), std_hz, shape_[m]));
      out.truth.push_back(static_cast<int>(m));
    }
    if (uniform_(engine_) < 0.2) {
      const double hz = 60.0 + 200.0 * uniform_(engine_);
      out.modes.push_back(seen(hz, 1e-3 * hz, random_shape(engine_)));
      out.truth.push_back(-1);
    }
    return out;
  }

  bool measured(int t) {
    return !(t >= 100 && t < 100 + scene_.gap_days) && uniform_(engine_) > 0.15;
  }

 private:
  SeenMode seen(double hz, double std_hz, const Eigen::VectorXcd& shape) {
    const double part = scene_.shape_std / std::sqrt(2.0 * kChannels);
    Eigen::VectorXcd noisy = shape;
    for (std::complex<double>& entry : noisy)
      entry += part * std::complex(normal_(engine_), normal_(engine_));
    const std::complex<double> phase = std::polar(1.0, 6.28 * uniform_(engine_));
    return {hz, std_hz, phase * noisy.normalized(), scene_.shape_std};
  }

  Scene scene_;
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_;
  std::vector<double> hz_;
  std::vector<double> trend_;
  std::vector<double> walk_;
  std::vector<Eigen::VectorXcd> shape_;
};

struct Score {
  int wrong = 0;
  int all = 0;
};

/// A mode is paired right if it is on the track that has most of this true mode, and the track has mostly this mode.
Score score_of(Year year, const TrackOptions& options = {}) {
  ModeTracks tracks(options);
  std::map<int, std::map<std::size_t, int>> counts;  // per true mode, per track
  std::map<std::size_t, std::map<int, int>> mirrored;
  std::vector<std::pair<int, std::size_t>> pairs;
  for (int t = 0; t < kDays; ++t) {
    const Year::Day day = year.day(t);
    if (!year.measured(t)) continue;
    const std::vector<std::size_t> track = tracks.add(t, day.modes);
    for (std::size_t m = 0; m < track.size(); ++m) {
      ++mirrored[track[m]][day.truth[m]];
      if (day.truth[m] < 0) continue;
      ++counts[day.truth[m]][track[m]];
      pairs.emplace_back(day.truth[m], track[m]);
    }
  }
  const auto most = [](const auto& count) {
    return std::ranges::max_element(count, {}, [](const auto& entry) { return entry.second; })
        ->first;
  };
  Score score;
  for (const auto& [truth, track] : pairs) {
    ++score.all;
    if (most(counts[truth]) != track || most(mirrored[track]) != truth) ++score.wrong;
  }
  return score;
}

Score score_of(const Scene& scene) {
  Score sum;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Score score = score_of(Year(20, seed, scene));
    sum.wrong += score.wrong;
    sum.all += score.all;
  }
  testing::Test::RecordProperty("wrong", sum.wrong);
  testing::Test::RecordProperty("all", sum.all);
  return sum;
}

TEST(ModeTracks, PairsModesOverAYearWithDriftsCrossingsAndMissingDays) {
  const Score score = score_of(Scene{});
  EXPECT_GT(score.all, 100000);
  EXPECT_LT(score.wrong, score.all / 1000) << score.wrong << " of " << score.all;
}

TEST(ModeTracks, PairsModesWithPoorShapesLargeDriftsAndALongGap) {
  const Score score =
      score_of(Scene{.shape_std = 0.3, .temperature = 2e-3, .walk = 4e-4, .gap_days = 60});
  EXPECT_LT(score.wrong, score.all / 1000) << score.wrong << " of " << score.all;
}

TEST(ModeTracks, NeedsTheShapesWhereModesCross) {
  // Else the test above would prove nothing about crossings.
  const Score score = score_of(Year(20, 1), {.shape_change = 100.0});
  EXPECT_GT(score.wrong, score.all / 20);
}

TEST(ModeTracks, KeepsTheTrackOfAModeThatJumps) {
  ModeTracks tracks;
  std::mt19937_64 engine(1);
  const Eigen::VectorXcd shape = random_shape(engine);
  for (int t = 0; t < 10; ++t) EXPECT_EQ(tracks.add(t, {{100.0, 0.01, shape, 0.05}})[0], 0U);
  EXPECT_EQ(tracks.add(10, {{102.0, 0.01, shape, 0.05}})[0], 0U);
  EXPECT_NEAR(tracks.mode(0).frequency_hz, 102.0, 0.1);
  EXPECT_EQ(tracks.add(11, {{108.0, 0.01, shape, 0.05}})[0], 1U) << "5.7 % is another mode";
}

TEST(ModeTracks, WorksWithoutShapes) {
  ModeTracks tracks;
  EXPECT_EQ(tracks.add(0, {{100.0, 0.01, {}, 0.0}, {120.0, 0.01, {}, 0.0}}).size(), 2U);
  EXPECT_EQ(tracks.add(1, {{120.1, 0.0, {}, 0.0}, {99.9, 0.0, {}, 0.0}}),
            (std::vector<std::size_t>{1, 0}));
  EXPECT_TRUE(tracks.add(2, {}).empty());
  EXPECT_EQ(tracks.size(), 2U);
}

TEST(DeviationsFromPast, NoticeAnOutlierOnceAndAStepForFourValues) {
  std::mt19937_64 engine(1);
  std::normal_distribution<double> normal;
  std::vector<double> values(60);
  for (double& value : values) value = 100.0 + normal(engine);
  values[20] += 30.0;
  for (std::size_t i = 40; i < values.size(); ++i) values[i] += 30.0;
  const std::vector<double> deviation = deviations_from_past(values, std::vector(60, 0.0));
  std::vector<std::size_t> far;
  for (std::size_t i = 0; i < deviation.size(); ++i)
    if (std::abs(deviation[i]) > 10.0) far.push_back(i);
  EXPECT_EQ(far, (std::vector<std::size_t>{20, 40, 41, 42, 43}));
}

TEST(DeviationsFromPast, AllowForTheDeviationOfTheValueItself) {
  std::vector<double> values(30, 100.0);
  values[10] = 103.0;
  std::vector<double> deviation(30, 0.0);
  deviation[10] = 1.5;
  EXPECT_DOUBLE_EQ(deviations_from_past(values, deviation)[10], 2.0);
  EXPECT_TRUE(deviations_from_past({}, {}).empty());
}

}  // namespace stageid::test_mode_tracks
