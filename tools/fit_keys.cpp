#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

#include "tools/fit_request.hpp"
#include "tools/number_range.hpp"

namespace stageid {

void describe_fit_keys(ConfigVisitor& v, FitRequest& f) {
  constexpr auto kOptional = Presence::optional;
  std::vector<double> band_hz;
  v.numbers("band_hz", band_hz, positive("Hz"), {2, 2}, kOptional, "left out: all lines");
  if (band_hz.size() == 2) {
    v.require(band_hz[0] < band_hz[1], "band_hz",
              "band_hz: is empty; write [LOW, HIGH] with LOW < HIGH");
    f.band_hz = {band_hz[0], band_hz[1]};
  }

  FlexibleValue modes = {"auto", {}, false, {}};
  FlexibleRule modes_rule;
  modes_rule.words = {"auto"};
  modes_rule.number = true;
  modes_rule.list = true;
  modes_rule.rule = positive("");
  v.flexible("modes", modes, modes_rule, kOptional,
             "auto, how many, or a list of frequencies in Hz");
  v.require(
      modes.is_list || modes.numbers.empty() || std::floor(modes.numbers[0]) == modes.numbers[0],
      "modes", "modes: a number says how many and is whole; write frequencies as a list [...]");
  // A list of one frequency would read as a count without the comma.
  f.modes = modes.word.empty()
                ? fmt::format("{}{}", fmt::join(modes.numbers, ","), modes.is_list ? "," : "")
                : modes.word;

  const auto word = [&](const char* key, std::string& value, std::vector<std::string> names,
                        const char* help) {
    std::size_t index = names.size() - 1;
    for (std::size_t i = 0; i < names.size(); ++i)
      if (names[i] == value) index = i;
    v.choice(key, index, names, kOptional, help);
    value = names[index] == "by_frf" ? "" : names[index];
  };
  word("weighting", f.weighting,
       {"unit", "inverse_magnitude", "relative", "noise_variance", "total_variance", "likelihood",
        "by_frf"},
       "of the cost; by_frf: noise variance if known, else total variance, else relative");
  word("hold", f.hold, {"none", "phase", "sinc", "exact", "by_frf"},
       "how the model meets sampled data; by_frf: exact unless it was taken out");

  const auto rank = [&](const char* key, std::string& value, std::vector<std::string> words,
                        const char* help) {
    FlexibleValue given = {value, {}, false, {}};
    FlexibleRule rule;
    rule.words = std::move(words);
    rule.number = true;
    rule.rule = positive("");
    v.flexible(key, given, rule, kOptional, help);
    v.require(given.numbers.empty() || std::floor(given.numbers[0]) == given.numbers[0], key,
              fmt::format("{}: a rank is a whole number", key));
    value = given.word.empty() ? fmt::format("{}", given.numbers.front()) : given.word;
  };

  FlexibleValue delay = {f.delay.empty() ? "by_frf" : f.delay, {}, false, {}};
  FlexibleRule delay_rule;
  delay_rule.words = {"estimate", "per_channel", "by_frf"};
  delay_rule.number = true;
  delay_rule.rule = any_number("s");
  v.flexible("delay_s", delay, delay_rule, kOptional,
             "a number, one for the plant, or one a channel");
  f.delay = delay.word.empty() ? fmt::format("{}", delay.numbers.front())
                               : (delay.word == "by_frf" ? "" : delay.word);

  rank("rigid_body", f.rigid_body, {"none", "full"},
       "the term B_0 / s^2: none, full, or the rank of B_0 (its degrees of freedom)");
  rank("residue_rank", f.residue_rank, {"full"}, "of a mode: full, or 1 for mechanical modes");
  word("direct_term", f.direct_term, {"none", "full"},
       "a constant: the compliance of modes above the band");
  word("damping", f.damping, {"proportional", "general"}, "numerators B_0, or B_0 + B_1 s");
  word("method", f.method, {"riv", "gn", "sk"}, "of the iteration");
  count(v, "max_iterations", f.max_iterations, 1, 1000000, kOptional, "of one fit");
}

}  // namespace stageid
