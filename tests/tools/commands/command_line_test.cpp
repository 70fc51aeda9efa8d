// Command line of the program: unknown commands and flags, help.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/program_fixture.hpp"

namespace stageid::test {
namespace test_command_line {

class CommandLine : public ProgramTest {};

TEST_F(CommandLine, Usage) {
  fail({"frff"}, 2, "unknown command 'frff'; did you mean 'frf'?");
  ends({"--json"}, 2, "no command");
  fail({"frf"}, 2, "required");
  fail({"frf", "a.slog", "-o", "b.h5", "--no-such-flag"}, 2, "--no-such-flag");
  fail({"frf", "a.slog", "-o", "b.h5", "--method", "lmp"}, 2, "(did you mean 'lpm'?)");
  fail({"frf", "a.slog", "-o", "b.h5", "--delay", "1e-3"}, 2, "add --compensate delay or hold");
  fail({"config", "schema", "stge"}, 2, "(did you mean 'stage'?)");
  fail({"frf", "a.slog", "-o", "b.h5", "--threads", "-1"}, 2, "--threads: got '-1'; expected");
  fail({"frf", "a.slog", "-o", "b.h5", "--transient-periods", "one"}, 2, "--transient-periods");
  fail({"log"}, 2, "a subcommand is missing");
  fail({"log", "inf", "a.slog"}, 2, "unknown argument 'inf'; did you mean 'info'?");
  fail({"log", "conv", "a.slog"}, 2, "unknown argument 'conv'; did you mean 'convert'?");
  fail({"log", "a.slog"}, 2, "unknown subcommand 'a.slog'");
  fail({"frf", "a.slog", "-o", "b.h5", "--methd=lpm"}, 2, "did you mean '--method'?");
  fail({"frf", "a.slog", "-o", "b.h5", "--jsn"}, 2, "did you mean '--json'? See 'stageid frf");
  fail({"manual", "-o", config_}, 1, "cannot create the directory");
  fail({"import", "x.csv", "--map", "m.yaml"}, 2, "--map: needs an output file");
  fail({"run", config_, "-o", "x.slog", "--backend", "simulator"}, 2, "--backend");
}

TEST_F(CommandLine, WhatIsNotInThisVersionSaysSo) {
  fail({"run", config_, "-o", "x.slog", "--backend", "can"}, 2, "has no group 'can'");
  fail({"run", config_, "-o", "x.slog", "--dashboard", "http://a"}, 2, "--dashboard");
  fail({"run", config_, "-o", "x.slog", "--backend", "replay"}, 2, "--replay LOG");
  fail({"export", "model.json", "-o", "m.step"}, 2, ".json, .h5, .hdf5, .csv, .mat");
}

TEST_F(CommandLine, TellsAllErrorsOfAFileAlsoAsJson) {
  const std::string bad = experiment("bad.yaml", "  lines: all", "  perods: 3\n  lines: none");
  const ProgramResult told = run({"run", bad, "-o", "x.slog"});
  EXPECT_EQ(told.exit_code, 2);
  EXPECT_THAT(told.err, testing::HasSubstr("lines: "));
  EXPECT_THAT(told.err, testing::HasSubstr("unknown key 'perods'; did you mean 'periods'?"));
  const nlohmann::json json = tell({"run", bad, "-o", "x.slog"}, 2);
  EXPECT_EQ(json["exit_code"], 2);
  ASSERT_EQ(json["errors"].size(), 2U);
  for (const nlohmann::json& error : json["errors"])
    EXPECT_THAT(told.err, testing::HasSubstr("stageid: " + error.get<std::string>() + "\n"));
  // Nothing but the kind of the file.
  fail({"run", name("small_stage.yaml"), "-o", "x.slog"}, 2, "expected stageid-experiment");
}

TEST_F(CommandLine, HelpIsThatOfTheCommand) {
  EXPECT_EQ(run({"help"}).out, run({"--help"}).out);
  EXPECT_EQ(run({"help", "frf"}).out, run({"frf", "--help"}).out);
  EXPECT_EQ(run({"help", "log", "info"}).out, run({"log", "info", "--help"}).out);
  fail({"help", "frff"}, 2, "help: unknown command 'frff'; did you mean 'frf'?");
  fail({"help", "log", "inf"}, 2, "help: unknown command 'inf' of log; did you mean 'info'?");
  fail({"help", "frf", "x"}, 2, "help: unknown command 'x' of frf; write 'stageid help frf'");
}

TEST_F(CommandLine, WithoutArgumentsThereAreThreeThingsToTry) {
  const ProgramResult shown = succeed({});
  for (const char* start :
       {"\n  stageid identify ", "\n  stageid import ", "\n  stageid config schema"})
    EXPECT_THAT(shown.out, testing::HasSubstr(start));
}

}  // namespace test_command_line
}  // namespace stageid::test
