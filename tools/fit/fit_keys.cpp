#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

#include "estimation/request/submodel_text.hpp"
#include "tools/fit/fit_words.hpp"

namespace stageid {

namespace {

/// One entry of `submodels`, with the parts of --submodel as keys.
void describe_submodel(ConfigVisitor& v, SubmodelRequest& r) {
  FlexibleValue order = {"", {0.0}};
  v.flexible("n", order, {.words = {"auto"}, .number = true, .rule = not_negative("")}, kOptional,
             "order of the denominator; auto: twice the number of modes found by a search");
  r.order_by_search = order.word == "auto";
  const double n = order.numbers.empty() ? 0.0 : order.numbers.front();
  const bool whole = std::floor(n) == n && n <= kLargestOrder;
  v.require(whole, "n",
            fmt::format("n: expected a whole number from 0 to {}, or auto", kLargestOrder));
  r.shape.order = static_cast<int>(std::min(n, 1e6));
  count(v, "l", r.shape.integrators, 0, 2, kOptional, "number of integrators: the power of 1/s");
  r.shape.numerator_degree = -1;
  count(v, "m", r.shape.numerator_degree, -1, 1000, kOptional,
        "degree of the numerator; -1: n + l - 1, strictly proper");
  if (r.shape.numerator_degree < 0) r.shape.numerator_degree = strictly_proper_degree(r);
  v.numbers("frequency_hz", r.frequency_hz, positive("Hz"), {}, kOptional,
            "starting frequencies: one per pole pair, then the real pole of an odd n; omitted: "
            "found by a search");
  v.numbers("damping_ratio", r.damping_ratio, {"", 0.0, 0.9, true}, {}, kOptional,
            "starting damping ratios: one per pair, or one for all; omitted: 0.01");
  const std::string fault = whole ? fault_of(r) : "";
  v.require(fault.empty(), r.order_by_search ? "n" : "m", fault);
}

void describe_submodels(ConfigVisitor& v, FitRequest& f) {
  v.items(
      "submodels",
      [&](ConfigVisitor& item) {
        SubmodelRequest request;
        describe_submodel(item, request);
        f.submodels.push_back(std::move(request));
      },
      {}, Presence::optional,
      "(B_0 + ... + B_m s^m) / (s^l (1 + a_1 s + ... + a_n s^n)), as in fit --submodel");
}

}  // namespace

void describe_fit_keys(ConfigVisitor& v, FitRequest& f) {
  std::vector<double> band_hz;
  v.numbers("band_hz", band_hz, positive("Hz"), {2, 2}, kOptional,
            "lowest and highest frequency; omitted: all lines");
  if (band_hz.size() == 2) {
    v.require(band_hz[0] < band_hz[1], "band_hz",
              "band_hz: the band is empty; write [LOW, HIGH] with LOW < HIGH");
    f.band_hz = {band_hz[0], band_hz[1]};
  }

  describe_submodels(v, f);
  FlexibleValue modes = {"by_submodels"};
  const FlexibleRule modes_rule = {.words = {"auto", "none", "by_submodels"},
                                   .number = true,
                                   .list = true,
                                   .rule = positive("")};
  v.flexible("modes", modes, modes_rule, kOptional,
             "auto, none, a number of modes, or a list of frequencies in Hz; by_submodels: none if "
             "submodels are listed, else auto");
  v.require(
      modes.is_list || modes.numbers.empty() || std::floor(modes.numbers[0]) == modes.numbers[0],
      "modes",
      "modes: the number of modes must be a whole number; write frequencies as a list [...]");
  using Modes = ModesRequest::Kind;
  if (modes.is_list) {
    f.modes = {Modes::given, 0, {}};
    std::ranges::sort(modes.numbers);
    for (const double frequency_hz : modes.numbers) f.modes.given.push_back({frequency_hz});
  } else if (!modes.numbers.empty()) {
    f.modes = {Modes::count, static_cast<int>(std::min(modes.numbers.front(), 1e6)), {}};
  } else if (modes.word != "by_submodels") {
    f.modes.kind = modes.word == "none" ? Modes::none : Modes::search;
  }

  // The last word means that the FRF decides.
  const auto word = [&](const char* key, auto& value, std::vector<std::string> names,
                        const char* help) {
    using Value = typename std::remove_reference_t<decltype(value)>::value_type;
    names.emplace_back("by_frf");
    std::size_t index = value ? static_cast<std::size_t>(*value) : names.size() - 1;
    v.choice(key, index, names, kOptional, help);
    value =
        index + 1 < names.size() ? std::optional<Value>(static_cast<Value>(index)) : std::nullopt;
  };
  word("weighting", f.weighting, words_before(Weighting::user),
       "weighting of the cost; by_frf: noise variance if known, else total variance, else "
       "relative; a single distorted realization is weighted by the scatter of its lines");
  word("hold", f.hold, words_of<HoldModel>(),
       "none; phase: half a sample of delay; sinc: phase and magnitude; exact: hold, delay and "
       "sampler, including aliasing; by_frf: exact unless the FRF is already hold-compensated");

  /// Reads a word or a rank. @returns the rank; 0: a word
  const auto rank = [&](const char* key, std::string& word_given, std::vector<std::string> words,
                        const char* help) {
    FlexibleValue given = {word_given};
    v.flexible(key, given, {.words = std::move(words), .number = true, .rule = positive("")},
               kOptional, help);
    word_given = given.word;
    if (given.numbers.empty()) return 0;
    const double number = given.numbers.front();
    v.require(std::floor(number) == number && number <= 1000.0, key,
              fmt::format("{}: the rank must be a whole number, at most 1000", key));
    return static_cast<int>(std::min(number, 1000.0));
  };

  FlexibleValue delay = {"by_frf"};
  const FlexibleRule delay_rule = {
      .words = {to_string(DelayModel::estimate), to_string(DelayModel::per_channel), "by_frf"},
      .number = true,
      .rule = any_number("s")};
  v.flexible("delay_s", delay, delay_rule, kOptional,
             "delay. A number: known; estimate: one for the plant; per_channel: one per channel; "
             "by_frf: from the FRF");
  if (!delay.numbers.empty()) f.delay = {DelayModel::fixed, delay.numbers.front()};
  if (const auto model = from_word<DelayModel>(delay.word)) f.delay = {*model, 0.0};

  using Body = RigidBodyRequest::Kind;
  std::string body = to_string(f.rigid_body.kind);
  f.rigid_body.rank = rank("rigid_body", body, words_of<Body>(),
                           "none, full, or the rank of B_0 in B_0 / s^2; suspension: modes below "
                           "the lines, for a body on soft springs; auto: chosen from the data; "
                           "by_submodels: none if submodels are listed, else auto");
  f.rigid_body.kind = from_word<Body>(body).value_or(Body::free);
  v.numbers("suspension_hz", f.rigid_body.suspension_hz, positive("Hz"), {}, kOptional,
            "known frequencies of rigid_body: suspension; omitted: fitted");
  v.require(f.rigid_body.suspension_hz.empty() || f.rigid_body.kind == Body::suspension,
            "suspension_hz", "suspension_hz: requires rigid_body: suspension");
  std::string full = "full";
  f.residue_rank =
      rank("residue_rank", full, {"full"}, "rank of the residues: full, or 1 for mechanical modes");
  word("direct_term", f.direct_term, {"none", "full"},
       "full: a constant, the compliance of modes above the band; by_frf: full if the outputs are "
       "accelerations, else chosen from the data");
  word("damping", f.general_damping, {"proportional", "general"},
       "proportional: numerators B_0; general: B_0 + B_1 s; by_frf: general if the outputs are "
       "accelerations, else chosen from the data");
  choose(v, "method", f.method, kOptional,
         "riv: refined instrumental variables; gn: Gauss-Newton; sk: Sanathanan-Koerner");
  count(v, "max_iterations", f.max_iterations, 1, 1000000, kOptional, "iterations per fit");
  v.number("search_seconds", f.search_seconds, not_negative("s"), kOptional,
           "limit of the search: work, in seconds of a typical core, so that the result does not "
           "depend on the machine; 0: unlimited");
}

}  // namespace stageid
