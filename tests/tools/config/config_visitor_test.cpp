#include "tools/config/config_visitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/key_suggestion.hpp"
#include "tests/support/process/error_message.hpp"
#include "tools/config/config_schema.hpp"
#include "tools/terminal/format_errors.hpp"

namespace stageid::test_config_visitor {

using testing::HasSubstr;

struct Small {
  double period_s = 4.0;
  std::vector<double> band_hz;
  std::int64_t seed = 0;
  std::string name = "x";
  std::size_t kind = 0;
  FlexibleValue delay = {"auto", {}, false, {}};
  double rms_n = 0.0;
  std::vector<double> items;
};

void describe(ConfigVisitor& v, Small& s) {
  v.number("period_s", s.period_s, positive("s"), Presence::required, "of the signal");
  v.numbers("band_hz", s.band_hz, not_negative("Hz"), {2, 2}, Presence::optional, "low and high");
  v.integer("seed", s.seed, 0, 100, Presence::optional, "of the noise");
  v.text("name", s.name, Presence::optional, "a name");
  v.choice("kind", s.kind, {"odd", "even"}, Presence::optional, "which");
  FlexibleRule rule;
  rule.words = {"auto"};
  rule.number = true;
  rule.rule = any_number("s");
  v.flexible("delay_s", s.delay, rule, Presence::optional, "delay");
  v.group(
      "level",
      [&](ConfigVisitor& level) {
        level.number("rms_n", s.rms_n, positive("N"), Presence::required, "rms");
        level.require(s.rms_n < 10.0, "rms_n", "rms_n: too large; lower it");
      },
      Presence::optional, "level");
  v.items(
      "items",
      [&](ConfigVisitor& item) {
        double x_m = 0.0;
        item.number("x_m", x_m, any_number("m"), Presence::required, "place");
        s.items.push_back(x_m);
      },
      {0, 2}, Presence::optional, "a few");
}

Small read(const std::string& text) {
  Small s;
  read_config(YamlDocument::parse("f.yaml", text), [&](ConfigVisitor& v) { describe(v, s); });
  return s;
}

std::string error_of(const std::string& text) {
  return test::error_message<FormatError>([&] { read(text); });
}

TEST(ConfigReader, ReadsEveryKindOfValue) {
  const Small s = read(
      "period_s: 2.5e-1\nband_hz: [0, +20]\nseed: 7\nname: 'a b'\nkind: even\ndelay_s: -.5\n"
      "level: {rms_n: 3}\nitems:\n  - {x_m: 1}\n  - {x_m: -2}\n");
  EXPECT_EQ(s.period_s, 0.25);
  EXPECT_EQ(s.band_hz, (std::vector<double>{0.0, 20.0}));
  EXPECT_EQ(s.seed, 7);
  EXPECT_EQ(s.name, "a b");
  EXPECT_EQ(s.kind, 1U);
  EXPECT_EQ(s.delay.numbers, std::vector<double>{-0.5});
  EXPECT_EQ(s.rms_n, 3.0);
  EXPECT_EQ(s.items, (std::vector<double>{1.0, -2.0}));
}

TEST(ConfigReader, WhatIsLeftOutKeepsItsDefault) {
  const Small s = read("period_s: 1\n");
  EXPECT_EQ(s.name, "x");
  EXPECT_EQ(s.delay.word, "auto");
}

// More of them are in tests/integration/messages.txt.
struct Wrong {
  const char* text;
  const char* message;
};

class ConfigReaderErrors : public testing::TestWithParam<Wrong> {};

TEST_P(ConfigReaderErrors, NameFileLineColumnAndRemedy) {
  EXPECT_EQ(error_of(GetParam().text), GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    Cases, ConfigReaderErrors,
    testing::Values(
        Wrong{"period: 4\n",
              "f.yaml:1:1: unknown key 'period'; the key includes the unit; write 'period_s'"},
        Wrong{"period_s: 1\nlevel: {rms_v: 3}\n",
              "f.yaml:2:9: unknown key 'rms_v'; the key includes the unit; write 'rms_n'"},
        Wrong{"period_s: 1\nlevel: {zzzzzz: 3}\n",
              "f.yaml:2:9: unknown key 'zzzzzz'; allowed keys: rms_n"},
        Wrong{"period_s: 1\nlevel: {}\n",
              "f.yaml:2:8: key 'rms_n' is missing in level; add it (rms)"},
        Wrong{"period_s: -.inf\n",
              "f.yaml:1:11: period_s: -.inf is not finite; write a number in s"},
        Wrong{"period_s: 1e999\n",
              "f.yaml:1:11: period_s: 1e999 is not finite; write a number in s"},
        Wrong{"period_s: 0x10\n",
              "f.yaml:1:11: period_s: got '0x10'; expected the number alone, in s (the unit "
              "is part of the key)"},
        Wrong{"period_s: --1\n", "f.yaml:1:11: period_s: got '--1'; expected a number in s"},
        Wrong{"period_s:\n", "f.yaml:1:10: period_s: got nothing; expected a number in s"},
        Wrong{"period_s: # later\nseed: 1\n",
              "f.yaml:1:10: period_s: got nothing; expected a number in s"},
        Wrong{"period_s: ~\n", "f.yaml:1:11: period_s: got nothing; expected a number in s"},
        Wrong{"period_s: [1]\n", "f.yaml:1:11: period_s: got a list; expected a number in s"},
        Wrong{"period_s: 1\nband_hz: [1, -2]\n",
              "f.yaml:2:14: band_hz: -2 is out of range; expected >= 0 Hz"},
        Wrong{"period_s: 1\nband_hz: 5\n",
              "f.yaml:2:10: band_hz: got '5'; expected a list [..., ...]"},
        Wrong{"period_s: 1\nseed: 101\n",
              "f.yaml:2:7: seed: 101 is out of range; expected 0 ... 100"},
        Wrong{"period_s: 1\ndelay_s: never\n",
              "f.yaml:2:10: delay_s: got 'never'; expected 'auto' or a number (any finite "
              "number in s)"},
        Wrong{"period_s: 1\nlevel: 3\n",
              "f.yaml:2:8: level is '3'; write a map, 'key: value' lines"},
        Wrong{"period_s: 1\nlevel: {rms_n: 30}\n", "f.yaml:2:16: rms_n: too large; lower it"},
        Wrong{"period_s: 1\nitems: [{x_m: 1}, {x_m: 2}, {x_m: 3}]\n",
              "f.yaml:2:8: items: got 3 entries; expected 0 to 2"},
        Wrong{"period_s: 1\nitems: [{x_m: 1}, {y_m: 2}]\n",
              "f.yaml:2:20: unknown key 'y_m'; did you mean 'x_m'?"},
        Wrong{"[1, 2]\n", "f.yaml:1:1: the file is a list; write a map, 'key: value' lines"}));

TEST(ConfigReader, KeepsAllThatIsWrong) {
  try {
    read(
        "period_s: 0\nsead: 3\nband_hz: [-1, x]\nlevel: {rms_n: a}\nitems: [{y_m: 2}, {x_m: b}]\n");
    FAIL() << "no error";
  } catch (const FormatErrors& errors) {
    std::vector<std::string> all;
    for (const FormatError& error : errors.all()) all.emplace_back(error.what());
    EXPECT_EQ(all.size(), 7U) << testing::PrintToString(all);
    EXPECT_EQ(all.front(), std::string(errors.what()));
    for (const char* place :
         {":1:11: period_s", ":2:1: unknown key 'sead'", ":3:11: band_hz", ":3:15: band_hz",
          ":4:16: rms_n", ":5:10: unknown key 'y_m'", ":5:25: x_m"})
      EXPECT_TRUE(std::ranges::any_of(
          all, [&](const std::string& text) { return text.find(place) != std::string::npos; }))
          << place << testing::PrintToString(all);
  }
}

TEST(KeySuggestion, FindsSwapsLossesAndUnits) {
  EXPECT_EQ(nearest_word("preiods", {"period_s", "periods"}), "periods");
  EXPECT_EQ(nearest_word("modes", {"weighting", "hold"}), "");
  EXPECT_EQ(nearest_word("A1", {"b1", "a1"}), "a1");
  EXPECT_EQ(nearest_word("FORCE_X", {"force_y", "force_x"}), "force_x");
  EXPECT_EQ(nearest_word("", {"hold"}), "");
  EXPECT_EQ(nearest_word("conv", {"convert", "info"}), "convert");
  EXPECT_EQ(nearest_word("conv", {"convert", "convolve"}), "");
  EXPECT_THAT(suggest_key("delay_ms", {"delay_s", "decay"}), HasSubstr("write 'delay_s'"));
}

TEST(ConfigSchema, ListsEveryKeyThatTheReaderKnows) {
  Small s;
  const std::vector<SchemaEntry> entries = config_schema([&](ConfigVisitor& v) { describe(v, s); });
  std::vector<std::string> keys;
  for (const SchemaEntry& entry : entries) keys.push_back(entry.key);
  EXPECT_EQ(keys, (std::vector<std::string>{"period_s", "band_hz", "seed", "name", "kind",
                                            "delay_s", "level", "rms_n", "items", "x_m"}));
  EXPECT_TRUE(entries[0].required);
  EXPECT_EQ(entries[0].unit, "s");
  EXPECT_EQ(entries[0].range, "> 0 s");
  EXPECT_EQ(entries[2].range, "0 ... 100");
  EXPECT_EQ(entries[3].default_value, "x");
  EXPECT_EQ(entries[7].depth, 1);
  EXPECT_THAT(schema_text(entries), HasSubstr("  rms_n:"));
}

TEST(ConfigSchema, WritesTheKeysOfEqualGroupsOnce) {
  const auto axis = [](ConfigVisitor& v) {
    double gain = 0.0;
    v.number("gain", gain, positive("N"), kOptional, "of the axis");
  };
  const auto other = [](ConfigVisitor& v) {
    double gain = 1.0;
    v.number("gain", gain, positive("N"), kOptional, "of the axis");
  };
  const std::string text = schema_text(config_schema([&](ConfigVisitor& v) {
    v.group("x", axis, kOptional, "loop");
    v.group("y", axis, kOptional, "loop");
    v.group("z", axis, kOptional, "loop");
    v.group("Rz", other, kOptional, "loop");
    std::vector<std::pair<std::string, std::string>> settings;
    v.named_texts("keys", settings, kOptional, "settings");
  }));
  EXPECT_EQ(text,
            "x:                           # loop (map)\n"
            "  gain:                      # of the axis (number; > 0 N; default 0)\n"
            "y:                           # loop (the keys of x)\n"
            "z:                           # loop (the keys of x)\n"
            "Rz:                          # loop (map)\n"
            "  gain:                      # of the axis (number; > 0 N; default 1)\n"
            "keys:                        # settings (map of name: text; default {})\n");
}

}  // namespace stageid::test_config_visitor
