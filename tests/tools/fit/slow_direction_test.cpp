// The dampings of a suspension far below the lines are a valley in which Gauss-Newton steps crawl.
#include <gtest/gtest.h>

#include <string>

#include "tests/tools/program_fixture.hpp"

namespace stageid::test_slow_direction {

class SlowDirection : public test::ProgramTest {};

TEST_F(SlowDirection, AFitWithASuspensionFarBelowTheLinesConverges) {
  for (const std::string seed : {"190", "238"}) {  // these needed hundreds of iterations
    const std::string file = experiment("slow.yaml", "seed: 7", "seed: " + seed);
    succeed("run " + file + " -o " + seed + ".slog");
    succeed("frf " + seed + ".slog -o slow.h5 --realizations 1,2");
    const nlohmann::json fit =
        tell("fit slow.h5 -o slow.json --rigid-body suspension:0.4:0.5 --direct-term full");
    EXPECT_LT(fit["cost"].size(), 100U);  // one per iterate
  }
}

}  // namespace stageid::test_slow_direction
