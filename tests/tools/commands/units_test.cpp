// A stage that is driven by currents and measured by accelerometers, with the real program from the check of its files
// to the report.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "frf/file/frf_file.hpp"
#include "tests/tools/program_fixture.hpp"

namespace stageid::test {
namespace test_units {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

struct Units : ProgramTest {
  Units() {
    std::string text = read_bytes(at("small_stage.yaml"));
    for (const char* name : {"a1", "a2", "a3"})
      text = replaced(text, std::string("name: ") + name + ", unit: N",
                      std::string("name: ") + name + ", unit: A, gain: 12");
    for (int i = 0; i < 3; ++i)
      text = replaced(text, "limit_n: 40, thermal_rms_n: 10", "limit: 3.5, thermal_rms: 0.8");
    text = replaced(text, "\nstuck_sensor_s",
                    "  - {name: b1, unit: m/s^2, position_m: [-0.26, 0.1, 0], window: 50}\n"
                    "  - {name: b2, unit: m/s^2, position_m: [ 0.23, 0.05, 0], window: 50}\n"
                    "\nstuck_sensor_s");
    text = replaced(text, "force_n: 1e-4", "force_n: 1e-5");
    write_bytes(at("currents.yaml"), text);
    std::string plan = read_bytes(config_);
    plan = replaced(plan, "stage: small_stage.yaml", "stage: currents.yaml");
    plan = replaced(plan, "rms_n: 1.0", "rms: 0.08");
    plan = replaced(plan, "\nfit:\n", "\nfrf:\n  outputs: [b1, b2]\n\n");
    plan = replaced(plan, "  rigid_body: suspension\n  suspension_hz: [0.4, 0.5]\n", "");
    plan = replaced(plan, "  direct_term: full ", "  # ");
    write_bytes(at("units.yaml"), plan);
  }
};

TEST_F(Units, AreThoseOfTheChannelsFromTheFilesToTheReport) {
  const ProgramResult checked = succeed("config check units.yaml");
  EXPECT_EQ(checked.err, "");
  const ProgramResult designed = succeed("design units.yaml -o excitation.h5");
  EXPECT_THAT(designed.out, testing::ContainsRegex("a1 +A "));
  EXPECT_THAT(designed.out, testing::ContainsRegex("b1 +m/s\\^2 "));

  succeed("identify units.yaml -o all");
  const FrfEstimate frf = read_frf(at("all/frf.h5"));
  EXPECT_EQ(frf.inputs.units, (std::vector<std::string>{"A", "A", "A"}));
  EXPECT_EQ(frf.outputs.units, (std::vector<std::string>{"m/s^2", "m/s^2"}));
  const json model = json::parse(read_bytes(at("all/model.json")));
  EXPECT_EQ(model["input_units"][0], "A");
  EXPECT_EQ(model["output_units"][0], "m/s^2");
  const json summary = json::parse(read_bytes(at("all/summary.json")));
  int found = 0;
  for (const json& mode : summary["truth"]["modes"])
    if (mode["true_frequency_hz"].get<double>() > 100.0) {
      EXPECT_TRUE(mode["found"]) << mode;
      EXPECT_NEAR(
          mode["natural_frequency_hz"].get<double>() / mode["true_frequency_hz"].get<double>(), 1.0,
          1e-3)
          << mode;
      ++found;
    }
  EXPECT_GE(found, 3);
  EXPECT_LT(summary["truth"]["relative_rms_error"].get<double>(), 0.05);
  const std::string report = read_bytes(at("all/report.html"));
  EXPECT_THAT(report, HasSubstr("m/s^2"));
  EXPECT_THAT(report, Not(HasSubstr("[m/N]")));
}

TEST_F(Units, StandInTheMessagesOfALimit) {
  const std::string plan = replaced(read_bytes(at("units.yaml")), "rms: 0.08", "rms: 3");
  write_bytes(at("strong.yaml"), plan);
  const ProgramResult refused = ends("design strong.yaml -o e.h5", 2);
  EXPECT_THAT(refused.err, testing::ContainsRegex("would be [0-9.]+ A, limit 3.5 A"));
  const std::string err = ends("run strong.yaml --force -o strong.slog", 4).err;
  const std::size_t stop = err.find("stageid: strong.slog: ");
  ASSERT_NE(stop, std::string::npos) << err;
  EXPECT_THAT(err.substr(stop), testing::ContainsRegex("[0-9.]+ (A|m/s\\^2|A/s), limit "));
}

TEST_F(Units, AKeyWithAUnitIsForThatUnitOnly) {
  const std::string stage = read_bytes(at("currents.yaml"));
  const auto error_of = [&](const std::string& from, const std::string& to) {
    write_bytes(at("wrong.yaml"), replaced(stage, from, to));
    return run("config check wrong.yaml").err;
  };
  EXPECT_THAT(error_of("window: 50", "window_m: 50"), HasSubstr("write 'window: NUMBER'"));
  EXPECT_THAT(error_of("unit: A", "unit: kN"), HasSubstr("expected one of N, Nm, A, V"));
  EXPECT_THAT(error_of("unit: m/s^2", "unit: rad/s^2"), HasSubstr("simulated without rotations"));
}

}  // namespace test_units
}  // namespace stageid::test
