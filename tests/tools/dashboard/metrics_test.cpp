#include "tools/dashboard/metrics.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace stageid::test_metrics {

using testing::HasSubstr;
using testing::Not;

const std::string kMeasuring = R"({"state":"running","runs_done":1,"runs_total":2,"exit_code":null,
  "health":{"cycles":1200,"late":3,"missing":0,"marked":2,"irregular":1},"watch":null})";

const std::string kWatching = R"({"state":"running","health":{},"watch":{"periods":40,"skipped":2,
  "learning":false,"statistic":12.5,"threshold":43.25,"changes":1,
  "tracked":[{"kind":"frequency","name":"a \"b\" \\ c\nd","change":1e-4,"deviation":2e-6,"statistic":12.5},
             {"kind":"delay","name":"delay","change":-5e-7,"deviation":1e-8,"statistic":0.5}],
  "noise":[{"channel":"s1","name":"noise of sensor 's1'","statistic":0.25,"power":1.5},
           {"channel":"s2","name":"noise of sensor 's2'","statistic":0.75}]}})";

TEST(Metrics, CountsRowsAndMarks) {
  const std::string text = metrics_text(kMeasuring);
  for (const char* line :
       {"stageid_state{state=\"running\",} 1\n", "# TYPE stageid_cycles_total counter\n",
        "\nstageid_cycles_total 1200\n", "\nstageid_late_total 3\n", "\nstageid_missing_total 0\n",
        "\nstageid_marked_total 2\n", "\nstageid_irregular_total 1\n",
        "\nstageid_runs_done_total 1\n", "\nstageid_runs 2\n"})
    EXPECT_THAT(text, HasSubstr(line));
  EXPECT_THAT(text, Not(HasSubstr("\nstageid_exit_code ")));
  EXPECT_THAT(text, Not(HasSubstr("watch")));
}

TEST(Metrics, ContainsWhatAWatchTracks) {
  const std::string text = metrics_text(kWatching);
  for (const char* line :
       {"\nstageid_watch_periods_total 40\n", "\nstageid_watch_skipped_periods_total 2\n",
        "\nstageid_watch_learning 0\n", "\nstageid_watch_changes_total 1\n",
        "\nstageid_watch_threshold 43.25\n", "\nstageid_watch_statistic 12.5\n",
        "\nstageid_tracked_change{kind=\"delay\",name=\"delay\",} -5e-07\n",
        "\nstageid_tracked_deviation{kind=\"delay\",name=\"delay\",} 1e-08\n",
        "\nstageid_tracked_statistic{kind=\"delay\",name=\"delay\",} 0.5\n",
        "\nstageid_noise_power{name=\"noise of sensor 's1'\",} 1.5\n",
        "\nstageid_noise_statistic{name=\"noise of sensor 's2'\",} 0.75\n"})
    EXPECT_THAT(text, HasSubstr(line));
  EXPECT_THAT(text, Not(HasSubstr("stageid_noise_power{name=\"noise of sensor 's2'\"")));
}

TEST(Metrics, EscapesLabels) {
  EXPECT_THAT(metrics_text(kWatching),
              HasSubstr(R"(stageid_tracked_change{kind="frequency",name="a \"b\" \\ c\nd",} 0.0001)"
                        "\n"));
}

TEST(Metrics, EveryLineIsOfTheFormat) {
  const std::string label = R"re([a-z_]+="([^"\]|\\["\n])*",?)re";
  const std::string line = "# (HELP|TYPE) stageid_[a-z_]+ .+|stageid_[a-z_]+(\\{(" + label +
                           ")+\\})? -?[0-9.]+(e[+-][0-9]+)?";
  for (const std::string& state : {kMeasuring, kWatching}) {
    std::istringstream lines(metrics_text(state));
    for (std::string one; std::getline(lines, one);) EXPECT_THAT(one, testing::MatchesRegex(line));
  }
  EXPECT_THAT(metrics_text("no JSON"), Not(HasSubstr("\nstageid_")));
}

}  // namespace stageid::test_metrics
