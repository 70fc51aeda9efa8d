// Wrong requests on the real program: one line, the right exit code, nothing left behind. The usual mistakes are in
// tests/integration/messages_cases.py, these are the rarer ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/tools/program_fixture.hpp"

namespace stageid::test {
namespace test_bad_request {

class BadRequest : public ProgramTest {};

TEST_F(BadRequest, MissingFiles) {
  fail("report none -o r.html", 1, "does not exist");
  fail("import none.csv", 1, "none.csv: cannot be read: No such file or directory;");
  fail("import .", 1, "cannot be read: Is a directory; give the name of a file");
}

TEST_F(BadRequest, WhatIsNoTable) {
  write_bytes(at("head.csv"), "u,y\n");
  fail("import head.csv", 2, "head.csv: contains column names but no row of numbers;");
  fail("import " + config_, 2, "is an experiment file, not a file of another program;");
}

TEST_F(BadRequest, Configurations) {
  const auto wrong = [&](const std::string& from, const std::string& to, const std::string& text) {
    fail("design " + experiment("bad.yaml", from, to) + " -o e.h5", 2, text);
  };
  wrong("axes: [a1, a2, a3]", "axes: [a1, a1]", "duplicate entry 'a1'");
  wrong("direct_term: full", "hold: perfect", "expected one of none, phase, sinc, exact, by_frf");
  wrong("direct_term: full", "submodels: [{n: 2, m: 3}]", "m=3 is above n + l = 2");
  wrong("direct_term: full", "submodels: [{order: 2}]", "unknown key 'order'");
  wrong("direct_term: full", "submodels: [{n: 17}]", "n: expected a whole number from 0 to 16");
  wrong("direct_term: full", "submodels: [{n: many}]", "n: ");
  wrong("direct_term: full", "submodels: [{n: 2, damping_ratio: [2]}]", "damping_ratio");
  wrong("suspension_hz: [0.4, 0.5]", "suspension_hz: [0.4, -1]", "suspension_hz");
}

TEST_F(BadRequest, StageFiles) {
  const auto wrong = [&](const std::string& from, const std::string& to, const std::string& text) {
    fail("design " + stage("bad.yaml", from, to) + " -o e.h5", 2, text);
  };
  wrong("[-0.26, 0, 0]", "[-2.6, 0, 0]", "is not on the plate");
  wrong("noise:", "faults: [{kind: extra_delay}]\nnoise:", "extra_delay needs at least 1 sample");
  wrong("noise:", "faults: [{kind: sensor_gain, mode: 6}]\nnoise:", "does not act on a mode");
  wrong("window_m: 1e-3}", "window_m: 1e-3, hard_window_m: 9e-4}", "is less than window_m");
  wrong("crossover_hz: 20,", "crossover_hz: 20, emergency: stop,", "emergency");
}

TEST_F(BadRequest, Modbus) {
  const auto wrong = [&](const std::string& group, const std::string& text) {
    fail("design " + stage("bad.yaml", "noise:", group + "\nnoise:") + " -o e.h5", 2, text);
  };
  wrong("modbus: {unit: 1}", "modbus: write exactly one of tcp and rtu");
  wrong("modbus: {tcp: {port: 1}, rtu: {device: x}}", "modbus: write exactly one of tcp and rtu");
  wrong("modbus: {tcp: {port: 0}}", "port: 0 is out of range");
  wrong("modbus: {rtu: {baud: 9600}}", "key 'device' is missing in rtu");
  wrong("modbus: {rtu: {device: x, parity: S}}", "parity: got 'S'; expected one of N, E, O");
  wrong("modbus: {tcp: {port: 1}, response_s: 2}", "worst_reply_s: less than response_s");
  wrong("supervisor: {modbus: {tcp: {port: 1}}, temperature_k: [1, 2]}",
        "key 'gravity_compensator_n' is missing in supervisor");
  wrong(
      "supervisor: {modbus: {tcp: {port: 1}}, temperature_k: [2, 1], gravity_compensator_n: [1, "
      "2]}",
      "temperature_k: write [low, high]");
  wrong(
      "modbus: {rtu: {device: x}}\nsupervisor: {modbus: {rtu: {device: x}}, temperature_k: [1, 2], "
      "gravity_compensator_n: [1, 2]}",
      "uses the same serial line");
  fail("design " + stage("bad.yaml", "backend: sim", "backend: modbus") + " -o e.h5", 2,
       "backend: modbus needs the group 'modbus'");
  fail("run " + config_ + " -o x.slog --backend modbus", 2, "has no group 'modbus'");
}

TEST_F(BadRequest, NodesThatCannotBeServed) {
  fail("node small_stage.yaml --can can0", 2, "has no group 'can'");
  const std::string file = std::string(STAGEID_SOURCE_DIR) + "/configs/stage/small_stage.yaml";
  fail("node " + file + " --modbus-tcp 0 --modbus-fault late", 2, "--modbus-fault: fault 'late'");
  fail("node " + file + " --modbus-rtu /dev/there-is-none", 1, "cannot be opened");
  fail("node " + file + " --modbus-rtu /dev/null --modbus-baud 9601", 2, "unsupported baud rate");
}

TEST_F(BadRequest, WhatACanBusCannotCarry) {
  const auto behind_can = [&](const std::string& group) {
    return stage("can.yaml", "backend: sim", "backend: can\ncan: {" + group + "}");
  };
  // Frames of 20 and 16 bytes at 1 and 0.5 Mbit/s: (34 + 476) + (34 + 386) us; heartbeats: 1.07 %.
  fail("run " + behind_can("buses: [{interface: can0, data_bit_rate_hz: 500e3}]") + " -o x.slog", 2,
       "can: can0 would have a load of 187 % at 2000 Hz (930 us per cycle); the limit is 80 %. Use "
       "at most "
       "849 Hz");
  const auto wrong = [&](const std::string& group, const std::string& text) {
    fail("run " + behind_can(group) + " -o x.slog", 2, text);
  };
  fail("run " + stage("can.yaml", "backend: sim", "backend: can") + " -o x.slog", 2,
       "has no group 'can'");
  wrong("mode: resident", "'buses'");
  wrong("buses: []", "buses");
  wrong("buses: [{interface: can0, actuators: [a1]}]", "channel 'a2' is not assigned to a bus");
  wrong("buses: [{interface: can0, actuators: [a9]}]", "unknown channel 'a9'");
  wrong("buses: [{interface: can0}, {interface: can0}]", "duplicate interface can0");
  wrong("actuator_range_n: [1, 2], buses: [{interface: can0}]", "2 entries for 3 channels");
  wrong("buses: [{interface: can0}], actuator_range_n: [1]",
        "actuator_range_n: 1 N cannot represent limit_n: 40 N of 'a1'");
  wrong("buses: [{interface: can0}], actuator_range_n: [40]", "cannot represent limit_n: 40 N");
  wrong("buses: [{interface: can0}], sensor_range_m: [1e-4]",
        "0.0001 m cannot represent window_m: 0.001 m of 's1'");
  wrong("buses: [{interface: can0, data_bit_rate: 5e6}]", "unknown key 'data_bit_rate'");
  wrong("mode: residential, buses: [{interface: can0}]", "did you mean 'resident'?");
}

TEST_F(BadRequest, AnExperimentPastTheLimitsIsNeitherDesignedNorRun) {
  const std::string loud = experiment("loud.yaml", "rms_n: 1.0", "rms_n: 15");
  fail("identify " + loud + " -o dir", 2, "|u| would be");
  fail("run " + loud + " -o loud.slog", 2, "|u| would be");
  const ProgramResult design = ends("design " + loud + " -o e.h5", 2);
  EXPECT_THAT(design.out, testing::HasSubstr("EXCEEDED"));
  EXPECT_FALSE(std::filesystem::exists(at("e.h5")));
  succeed("design " + loud + " -o e.h5 --force");
  EXPECT_TRUE(std::filesystem::exists(at("e.h5")));
  fail("run " + loud + " --excitation e.h5 -o loud.slog", 2, "|u| would be");
}

TEST_F(BadRequest, Outputs) {
  make_model();
  std::filesystem::create_directory(at("folder"));
  for (const std::string& command :
       {"design " + config_, "run " + config_, std::string("frf run.slog"),
        std::string("modes frf.h5"), std::string("fit frf.h5"), std::string("export model.json"),
        std::string("report frf.h5"), std::string("log convert run.slog")}) {
    const std::string ending = command.starts_with("run") ? ".slog" : ".h5";
    for (const std::string folder : {"nowhere", "experiment.yaml"})
      fail(command + " -o " + folder + "/x" + ending, 1, folder + "/x" + ending);
    if (command.starts_with("export") || command.starts_with("log") || ending == ".slog") continue;
    fail(command + " -o folder", 1, "is a directory");
  }
  fail("report frf.h5 frf.h5 -o r.html", 2, "frf.h5: duplicate file");
  fail("report frf.h5 -o r.html --compare none", 1, "none: does not exist; check the path");
  fail("export model.json -o m.h5 --driving-point s3 a1", 2,
       "--driving-point: 's3' is not an output of the model; use one of s1, s2");
  fail("identify " + config_ + " -o experiment.yaml", 1, "experiment.yaml");
  fail("identify " + config_ + " -o /proc/stageid", 1, "/proc/stageid");
}

TEST_F(BadRequest, AFullDiskLeavesNothingBehind) {
  make_model();
  ProgramOptions full;
  full.largest_file_bytes = 2000;
  fail("design " + config_ + " -o e.h5", 1, "e.h5", full);
  fail("frf run.slog -o f.h5", 1, "f.h5", full);
  fail("fit frf.h5 -o m.json --band 120 800", 1, "m.json", full);
  fail("export model.json -o m.h5", 1, "m.h5", full);
  fail("export model.json -o m.csv", 1, "m.csv", full);
  fail("report frf.h5 -o r.html", 1, "r.html", full);
  fail("export model.json -o m.mat", 1, "m.mat: cannot be written", full);
  fail("log convert run.slog -o l.h5", 1, "l.h5", full);
  fail("log convert run.slog -o l.csv", 1, "l.csv: cannot be wr", full);
  // The part recorded before the disk was full is kept.
  full.largest_file_bytes = 200000;
  ends("run " + config_ + " -o full.slog", 1,
       "stageid: full.slog: cannot be written: File too large; raise", full);  // named once
  EXPECT_TRUE(std::filesystem::exists(at("full.slog")));
}

TEST_F(BadRequest, AResultThatWouldReplaceWhatItIsMadeOf) {
  make_log();
  make_frf();
  const auto refused = [&](const std::string& line) {
    fail(line, 2, "is an input file and would be overwritten");
  };
  const std::string log = "run.slog";
  const std::string frf = "frf.h5";
  refused("frf " + log + " -o " + log);
  refused("fit " + frf + " -o " + frf);
  refused("modes " + frf + " -o " + frf);
  refused("design " + config_ + " -o " + config_);
  succeed("log convert " + log + " -o log.h5");
  refused("log convert log.h5 -o log.h5");
  succeed("export " + frf + " -o f.uff");
  // Another name of the same file.
  const auto link = [&](const char* to, const char* from) {
    std::filesystem::create_symlink(to, at(from));
    return std::string(from);
  };
  refused("frf " + log + " -o " + link("run.slog", "link.h5"));
  refused("import f.uff -o " + link("f.uff", "again.h5"));
  refused("export " + frf + " -o " + link("frf.h5", "export.mat"));
  refused("report " + frf + " -o " + link("frf.h5", "page.html"));
  refused("report " + log + " -o " + link("frf.h5", "other.html") + " --compare " + frf);
  refused("plot cmif " + frf + " -o " + link("frf.h5", "plot.svg"));
}

TEST_F(BadRequest, Fits) {
  make_frf();
  const auto wrong = [&](const std::string& flags, const std::string& text) {
    fail("fit frf.h5 -o m.json " + flags, 2, text);
  };
  wrong("--residue-rank 0", "--residue-rank: got '0'; expected full or a rank");
  wrong("--residue-rank 2 --damping general", "full or 1 with general damping");
  wrong("--modes 12,x", "--modes");
  wrong("--max-iterations 0", "max_iterations");
  fail("fit frf.h5 -o m.json --weighting none.h5", 1, "none.h5");
}

}  // namespace test_bad_request
}  // namespace stageid::test
