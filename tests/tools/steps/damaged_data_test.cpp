// Damaged or unexpected logs and FRFs, with the real program.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "tests/support/logs/hdf5_surgery.hpp"
#include "tests/tools/program_fixture.hpp"

namespace stageid::test {
namespace test_damaged_data {

using Operation = std::function<void(Hdf5Surgery&)>;

struct DamagedData : ProgramTest {
  void make_hdf5_log() const {
    make_log();
    succeed({"log", "convert", "run.slog", "-o", "whole.h5"});
  }
  /// A copy of `whole` after an operation.
  std::string spoilt(const std::string& whole, const Operation& operate) const {
    std::filesystem::copy_file(at(whole), at("spoilt.h5"),
                               std::filesystem::copy_options::overwrite_existing);
    Hdf5Surgery surgery(at("spoilt.h5"));
    operate(surgery);
    return "spoilt.h5";
  }
};

TEST_F(DamagedData, NativeLogs) {
  make_log();
  const std::string whole = read_bytes(at("run.slog"));
  const auto frf = [&](const std::string& bytes, const std::string& text) {
    write_bytes(at("bad.slog"), bytes);
    fail({"frf", "bad.slog", "-o", "f.h5"}, 2, text);
  };
  frf(whole.substr(0, whole.size() * 2 / 3), "stageid log recover");
  frf(whole.substr(0, 10), "bad.slog");
  frf("", "bad.slog");
  frf(std::string(5000, 'x'), "bad.slog");
  for (const double place : {0.3, 0.5, 0.9}) {
    std::string flipped = whole;
    flipped[static_cast<std::size_t>(place * static_cast<double>(whole.size()))] ^= 0x10;
    frf(flipped, "bad.slog");
    ends({"log", "verify", "bad.slog"}, 2, "stageid log recover");
  }
  EXPECT_THAT(succeed({"log", "verify", "run.slog"}).out, testing::HasSubstr("intact"));
}

TEST_F(DamagedData, RecoverSavesWhatIsLeft) {
  make_log();
  const std::string whole = read_bytes(at("run.slog"));
  write_bytes(at("cut.slog"), whole.substr(0, whole.size() * 2 / 3));
  const ProgramResult recover =
      succeed({"log", "recover", "cut.slog", "-o", "saved.slog", "--json"});
  EXPECT_THAT(recover.out, testing::HasSubstr("\"complete_runs\": 5"));
  fail({"log", "recover", "cut.slog", "-o", "saved.slog"}, 2, "already exists");
  succeed({"log", "verify", "saved.slog"});
  succeed({"frf", "saved.slog", "-o", "f.h5", "--realizations", "1"});
}

TEST_F(DamagedData, Hdf5Logs) {
  make_hdf5_log();
  const auto wrong = [&](const Operation& operate, const std::string& text) {
    fail({"frf", spoilt("whole.h5", operate), "-o", "f.h5"}, 2, text);
  };
  const double nan = std::nan("");
  const double infinity = std::numeric_limits<double>::infinity();
  wrong([&](auto& h) { h.poke("/runs/0001/sensors", 2503, nan); }, "0001");
  wrong([&](auto& h) { h.poke("/runs/0001/actuators", 7001, infinity); }, "0001");
  wrong([&](auto& h) { h.poke("/runs/0002/excitation", 5, nan); }, "0002");
  wrong([&](auto& h) { h.remove("/runs/0001/sensors"); }, "/runs/0001/sensors");
  wrong([&](auto& h) { h.remove("/channels/actuators"); }, "/channels/actuators");
  wrong([&](auto& h) { h.remove("/runs"); }, "/runs");
  wrong([&](auto& h) { h.reshape("/runs/0001/sensors", {2500, 3}); }, "/runs/0001/sensors");
  wrong([&](auto& h) { h.reshape("/runs/0001/sensors", {2400, 2}); }, "0001");
  wrong([&](auto& h) { h.reshape("/runs/0001/excitation", {499, 3}); }, "/runs/0001/excitation");
  wrong([&](auto& h) { h.set_attribute("/", "period_samples", 490); }, "spoilt.h5");
  wrong([&](auto& h) { h.set_attribute("/", "period_samples", 0); }, "period_samples");
  wrong([&](auto& h) { h.set_attribute("/", "sample_rate_hz", -1); }, "sample_rate_hz");
}

TEST_F(DamagedData, ExperimentsThatDoNotSuffice) {
  make_hdf5_log();
  const std::string fewer = spoilt("whole.h5", [](auto& h) {
    for (const char* run : {"/runs/0002", "/runs/0005", "/runs/0008"}) h.remove(run);
  });
  fail({"frf", fewer, "-o", "f.h5", "--inputs", "a1,a2,a3"}, 2, "experiments");
}

/// Of every three experiments, the second repeats the first.
void repeat_first_experiment(Hdf5Surgery& log) {
  for (int m = 0; m < 3; ++m) {
    const std::string first = fmt::format("/runs/{:04}", 3 * m);
    const std::string second = fmt::format("/runs/{:04}", 3 * m + 1);
    log.remove(second);
    log.copy(first, second);
    log.set_attribute(second, "experiment", 1);
  }
}

TEST_F(DamagedData, AnAxisThatIsNeverExcitedIsRefusedOrLeftOut) {
  make_hdf5_log();
  const std::string two_axes = spoilt("whole.h5", repeat_first_experiment);
  fail({"frf", two_axes, "-o", "f.h5", "--inputs", "a1,a2,a3"}, 2,
       "3 inputs but only 2 excited axes (a1, a3)");
  // If it is not requested, it is omitted. It moves with the loop, so the response is not that of the plant.
  const ProgramResult without = ends({"frf", two_axes, "-o", "f.h5"}, 3);
  EXPECT_THAT(without.out,
              testing::ContainsRegex("fault +a2 +is not an input of the sub-plant but moves"));
}

TEST_F(DamagedData, ThreeExperimentsOfRankTwoAreSingular) {
  // Every axis moves in every experiment, so only the rank reveals the missing one.
  config_ = experiment("all_axes.yaml", "lines: all", "lines: all\n  scheme: orthogonal_dft");
  make_hdf5_log();
  fail({"frf", spoilt("whole.h5", repeat_first_experiment), "-o", "f.h5"}, 2,
       "singular excitation in realization 1 (counted from 1), line 4 (16 Hz)");
}

TEST_F(DamagedData, Hdf5FilesCutOrFlipped) {
  make_hdf5_log();
  make_frf();
  for (const char* file : {"whole.h5", "frf.h5"}) {
    const std::string whole = read_bytes(at(file));
    const std::vector<std::string> command =
        std::string(file) == "frf.h5" ? std::vector<std::string>{"modes", "bad.h5"}
                                      : std::vector<std::string>{"log", "info", "bad.h5"};
    for (const std::size_t size :
         {std::size_t{5}, std::size_t{100}, whole.size() / 2, whole.size() - 1}) {
      write_bytes(at("bad.h5"), whole.substr(0, size));
      fail(command, 2, "bad.h5");
    }
    for (const std::size_t place : {std::size_t{0}, std::size_t{8}, std::size_t{13}}) {
      std::string flipped = whole;
      flipped[place] ^= 0x10;
      write_bytes(at("bad.h5"), flipped);
      fail(command, 2, "bad.h5");
    }
  }
}

TEST_F(DamagedData, FrequencyResponses) {
  make_frf();
  const auto wrong = [&](const Operation& operate, const std::string& text) {
    fail({"fit", spoilt("frf.h5", operate), "-o", "m.json"}, 2, text);
  };
  const double nan = std::nan("");
  wrong([&](auto& h) { h.poke("/response", 17, nan); }, "/response");
  wrong([&](auto& h) { h.poke("/response", 17, std::numeric_limits<double>::infinity()); },
        "/response");
  wrong([&](auto& h) { h.poke("/noise_variance", 17, nan); }, "/noise_variance");
  wrong([&](auto& h) { h.poke("/noise_variance", 17, -1.0); }, "/noise_variance");
  wrong([&](auto& h) { h.poke("/frequency_hz", 5, 1.0); }, "/frequency_hz");
  wrong([&](auto& h) { h.poke("/frequency_hz", 5, nan); }, "/frequency_hz");
  wrong([&](auto& h) { h.remove("/response"); }, "/response");
  wrong([&](auto& h) { h.remove("/inputs"); }, "/inputs");
  wrong([&](auto& h) { h.reshape("/response", {197, 3, 2}); }, "/response");
  wrong([&](auto& h) { h.reshape("/response", {197, 6}); }, "/response");
  wrong([&](auto& h) { h.reshape("/noise_variance", {196, 2, 3}); }, "/noise_variance");
}

TEST_F(DamagedData, FilesOfAnotherKind) {
  make_model();
  fail({"fit", "model.json", "-o", "m.json"}, 2, "model.json");
  fail({"fit", "run.slog", "-o", "m.json"}, 2, "run.slog");
  fail({"frf", "frf.h5", "-o", "f.h5"}, 2, "frf.h5");
  fail({"export", "frf.h5", "-o", "m.h5"}, 2, "frf.h5");
  fail({"report", config_, "-o", "r.html"}, 2, "experiment.yaml:");
  fail({"fit", "frf.h5", "-o", "m.json", "--modes", "model.json"}, 2, "model.json");
  write_bytes(at("cut.json"), read_bytes(at("model.json")).substr(0, 500));
  fail({"export", "cut.json", "-o", "m.h5"}, 2, "cut.json");
}

}  // namespace test_damaged_data
}  // namespace stageid::test
