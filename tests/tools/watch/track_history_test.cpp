#include "tools/watch/track_history.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace stageid::test_track_history {

TEST(TrackHistory, KeepsAllOfAShortWatch) {
  TrackHistory history;
  EXPECT_EQ(history.json(), "{\"time_s\":[],\"change\":[],\"deviation\":[]}");
  for (int t = 1; t <= 3; ++t)
    history.add(t, Eigen::Vector2d(1e-4 * t, -t), Eigen::Vector2d(1e-6, 0.5));
  EXPECT_EQ(nlohmann::json::parse(history.json()),
            nlohmann::json::parse(R"({"time_s":[1,2,3],"change":[[1e-4,2e-4,3e-4],[-1,-2,-3]],
                                      "deviation":[[1e-6,1e-6,1e-6],[0.5,0.5,0.5]]})"));
}

TEST(TrackHistory, CoversALongWatchEvenlyWithoutGrowing) {
  TrackHistory history;
  constexpr int kPeriods = 100000;
  for (int t = 0; t < kPeriods; ++t)
    history.add(t, Eigen::VectorXd::Constant(1, t), Eigen::VectorXd::Ones(1));
  const nlohmann::json json = nlohmann::json::parse(history.json());
  const auto times = json["time_s"].get<std::vector<double>>();
  ASSERT_LT(times.size(), TrackHistory::kMost);
  ASSERT_GE(times.size(), TrackHistory::kMost / 2 - 1);
  EXPECT_EQ(json["change"][0].get<std::vector<double>>(), times);
  EXPECT_EQ(times[0], 0.0);
  // Five digits: the steps are even within ten periods.
  for (std::size_t k = 1; k < times.size(); ++k)
    EXPECT_NEAR(times[k] - times[k - 1], times[1], 10.0);
  EXPECT_GE(times.back(), kPeriods - 2 * times[1]);
}

}  // namespace stageid::test_track_history
