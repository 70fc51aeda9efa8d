// Command line of the program: unknown commands and flags, help.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/program_fixture.hpp"

namespace stageid::test {
namespace test_command_line {

class CommandLine : public ProgramTest {};

// The usual mistakes are in tests/integration/messages_cases.py.
TEST_F(CommandLine, Usage) {
  ends("--json", 2, "no command");
  fail("frf a.slog -o b.h5 --methd=lpm", 2, "did you mean '--method'?");
  fail("frf a.slog -o b.h5 --jsn", 2, "did you mean '--json'? See 'stageid frf");
}

TEST_F(CommandLine, TellsAllErrorsOfAFileAlsoAsJson) {
  const std::string bad = experiment("bad.yaml", "  lines: all", "  perods: 3\n  lines: none");
  const ProgramResult told = run("run " + bad + " -o x.slog");
  EXPECT_EQ(told.exit_code, 2);
  EXPECT_THAT(told.err, testing::HasSubstr("lines: "));
  EXPECT_THAT(told.err, testing::HasSubstr("unknown key 'perods'; did you mean 'periods'?"));
  const nlohmann::json json = tell("run " + bad + " -o x.slog", 2);
  EXPECT_EQ(json["exit_code"], 2);
  ASSERT_EQ(json["errors"].size(), 2U);
  for (const nlohmann::json& error : json["errors"])
    EXPECT_THAT(told.err, testing::HasSubstr("stageid: " + error.get<std::string>() + "\n"));
}

TEST_F(CommandLine, HelpIsThatOfTheCommand) {
  EXPECT_THAT(succeed("--version").out, testing::MatchesRegex("stageid [0-9.]+\n"));
  EXPECT_EQ(run("help").out, run("--help").out);
  EXPECT_EQ(run("help frf").out, run("frf --help").out);
  EXPECT_EQ(run("help log info").out, run("log info --help").out);
  fail("help log inf", 2, "help: unknown command 'inf' of log; did you mean 'info'?");
  fail("help frf x", 2, "help: unknown command 'x' of frf; write 'stageid help frf'");
}

TEST_F(CommandLine, WithoutArgumentsThereAreThreeThingsToTry) {
  const ProgramResult shown = succeed("");
  for (const char* start :
       {"\n  stageid identify ", "\n  stageid import ", "\n  stageid config schema"})
    EXPECT_THAT(shown.out, testing::HasSubstr(start));
}

}  // namespace test_command_line
}  // namespace stageid::test
