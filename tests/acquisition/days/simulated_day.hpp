#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "acquisition/loop/run_experiment.hpp"
#include "tests/acquisition/days/misfortune.hpp"

namespace stageid::test {

struct DayReport {
  int experiments = 0;
  int attempts = 0;
  std::uint64_t cycles = 0;
  std::map<Trouble, int> troubles;
  std::map<ExperimentEnd, int> ends;
  std::vector<std::string> broken;  ///< invariants that did not hold
};

/// One day of a stage in virtual time: experiments that fail for all kinds of reasons and are resumed until they are
/// complete. The seed and the number decide everything that happens.
///
/// docs/decisions/simulated-days.md lists the invariants.
DayReport simulate_day(std::uint64_t seed, std::uint64_t day);

}  // namespace stageid::test
