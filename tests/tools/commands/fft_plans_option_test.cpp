// stageid frf --fft-wisdom: plans that were timed once, end to end.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <thread>

#include "frf/file/frf_file.hpp"
#include "tests/tools/program_fixture.hpp"

namespace stageid::test {
namespace test_fft_plans_option {

using testing::HasSubstr;

struct FftWisdomOption : ProgramTest {
  std::vector<std::string> frf(const std::string& output) const {
    return {"frf", "run.slog", "-o", output, "--fft-wisdom", "plans"};
  }
};

TEST_F(FftWisdomOption, TheSecondRunReadsThePlansAndWritesTheSameBytes) {
  make_log();
  succeed(frf("one.h5"));
  const std::string plans = read_bytes(at("plans"));
  succeed(frf("two.h5"));
  EXPECT_TRUE(same_bytes(plans, read_bytes(at("plans"))));
  EXPECT_TRUE(same_bytes(read_bytes(at("one.h5")), read_bytes(at("two.h5"))));
  const FrfEstimate timed = read_frf(at("one.h5"));
  const std::string digest = plans.substr(plans.find('\n') - 32, 32);
  EXPECT_THAT(timed.provenance_json, HasSubstr("\"fft_plans\":\"" + digest + "\""));
  succeed({"frf", "run.slog", "-o", "rule.h5"});
  const FrfEstimate rule = read_frf(at("rule.h5"));
  EXPECT_THAT(rule.provenance_json, testing::Not(HasSubstr("fft_plans")));
  EXPECT_LT((timed.response - rule.response).norm(), 1e-9 * rule.response.norm());
}

TEST_F(FftWisdomOption, WhatCannotBeUsedIsToldAndNothingWritten) {
  make_log();
  write_bytes(at("plans"), "(fftw-3.3.10 fftw_wisdom #x0 #x0 #x0 #x0\n)\n");
  fail(frf("one.h5"), 2, "plans: is not a file of FFT plans; remove it");
  fail({"frf", "run.slog", "-o", "one.h5", "--fft-wisdom", "no/plans"}, 1, "no/plans");
}

TEST_F(FftWisdomOption, TwoProgramsAtOnceLeaveAWholeFile) {
  make_log();
  std::array<ProgramResult, 2> results;
  std::thread other([&] { results[1] = run(frf("two.h5")); });
  results[0] = run(frf("one.h5"));
  other.join();
  for (const ProgramResult& result : results) EXPECT_EQ(result.exit_code, 0) << result.err;
  const std::string plans = read_bytes(at("plans"));
  succeed(frf("three.h5"));
  EXPECT_TRUE(same_bytes(plans, read_bytes(at("plans"))));
}

}  // namespace test_fft_plans_option
}  // namespace stageid::test
