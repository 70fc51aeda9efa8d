#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <iostream>

#include "tests/acquisition/days/simulated_day.hpp"

namespace stageid::test_simulated_days {

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

// STAGEID_DAYS: how many, STAGEID_DAY_SEED: their seed, STAGEID_FIRST_DAY: to repeat one.
TEST(SimulatedDays, NoInvariantIsBroken) {
  const std::uint64_t seed = from_environment("STAGEID_DAY_SEED", 1);
  const std::uint64_t first = from_environment("STAGEID_FIRST_DAY", 0);
  const std::uint64_t days = from_environment("STAGEID_DAYS", 1);
  test::DayReport all;
  for (std::uint64_t day = first; day < first + days; ++day) {
    const test::DayReport report = test::simulate_day(seed, day);
    for (const std::string& broken : report.broken)
      ADD_FAILURE() << "day " << day << ", " << broken;
    all.experiments += report.experiments;
    all.attempts += report.attempts;
    all.cycles += report.cycles;
    for (const auto& [trouble, count] : report.troubles) all.troubles[trouble] += count;
    for (const auto& [end, count] : report.ends) all.ends[end] += count;
  }
  std::cout << fmt::format("{} days: {} experiments, {} attempts, {} recorded cycles\n", days,
                           all.experiments, all.attempts, all.cycles);
  EXPECT_EQ(all.troubles.size(), 10U) << "every kind of trouble occurs";
  EXPECT_EQ(all.ends.size(), 5U) << "experiments end in every way";
}

}  // namespace stageid::test_simulated_days
