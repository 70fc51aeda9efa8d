// How often a fit with default settings finds the modes: blind fits of random stages (4 x 13, 5 to 25 modes, up to
// three close pairs, up to three peaks of the CMIF removed, noise -30 to -70 dB), compared with the plain iteration of
// the paper.
//
//   blind_fit_study [stages = 40] [first seed = 1] [threads = 0: all] [sensors x actuators = 4x13] [-v: every report]
//
// Prints one line per stage, the decisions of every failure, and the share and times at the end.

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "tests/support/models/model_blind_fit.hpp"

int main(int argc, char** argv) {
  const int stages = argc > 1 ? std::atoi(argv[1]) : 40;
  const auto first = static_cast<std::uint64_t>(argc > 2 ? std::atoll(argv[2]) : 1);
  const int threads = argc > 3 ? std::atoi(argv[3]) : 0;
  stageid::test::RandomStageSpec spec;
  if (argc > 4) std::sscanf(argv[4], "%dx%d", &spec.outputs, &spec.inputs);
  const bool verbose = std::strcmp(argv[argc - 1], "-v") == 0;
  std::vector<std::uint64_t> failed;
  std::vector<double> seconds;
  int plain = 0;
  for (std::uint64_t seed = first; seed < first + static_cast<std::uint64_t>(stages); ++seed) {
    const stageid::test::RandomStage stage = stageid::test::draw_random_stage(seed, spec);
    const stageid::test::BlindFit fit = stageid::test::fit_blind(stage, threads);
    seconds.push_back(fit.seconds);
    fmt::print("seed {}: {}\n", seed, stage.description());
    const std::string report = fit.report();
    fmt::print("{}", fit.success && !verbose ? report.substr(0, report.find('\n') + 1) : report);
    std::fflush(stdout);
    if (!fit.success) failed.push_back(seed);
    if (stageid::test::plain_iteration_succeeds(stage, fit.from_truth.model.fit.cost, threads))
      ++plain;
  }
  if (seconds.empty()) return 2;
  std::sort(seconds.begin(), seconds.end());
  fmt::print("{} of {} succeeded; time a fit: median {:.2f} s, longest {:.2f} s; failing seeds:",
             stages - static_cast<int>(failed.size()), stages, seconds[seconds.size() / 2],
             seconds.back());
  for (const std::uint64_t seed : failed) fmt::print(" {}", seed);
  fmt::print("\nthe paper's plain iteration from the same peaks, delay given: {} of {}\n", plain,
             stages);
  return 0;
}
