#include "tools/workbench/edit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_members.hpp"
#include "estimation/request/request_flags.hpp"
#include "tools/workbench/model_request.hpp"

namespace stageid {
namespace {

using Modes = ModesRequest::Kind;

constexpr double kSameMode = 1e-3;  // relative distance of a removed mode from the nearest one
constexpr std::size_t kMostModes = 1000;
constexpr std::size_t kLongestWord = 64;

double require_number(const SortedJson& action, const char* key, double low, double high) {
  const std::optional<double> value = number_in(action, key);
  if (!value || !(*value > low && *value < high))
    fail_request("{}: expected a number above {} and below {}", key, low, high);
  return *value;
}

Edit add_mode(const SortedJson& action, FitRequest request) {
  const ModeCandidate mode = rounded_mode(require_number(action, "frequency_hz", 0.0, 1e9),
                                          action.contains("damping_ratio")
                                              ? require_number(action, "damping_ratio", 0.0, 1.0)
                                              : ModeCandidate{}.damping_ratio);
  std::vector<ModeCandidate>& modes = request.modes.given;
  if (modes.size() >= kMostModes) fail_request("at most {} modes", kMostModes);
  modes.insert(std::ranges::upper_bound(modes, mode.frequency_hz, {}, &ModeCandidate::frequency_hz),
               mode);
  request.modes.kind = Modes::given;
  return {std::move(request), fmt::format("added {:.6g} Hz", mode.frequency_hz)};
}

Edit remove_mode(const SortedJson& action, FitRequest request) {
  const double frequency_hz = require_number(action, "frequency_hz", 0.0, 1e9);
  std::vector<ModeCandidate>& modes = request.modes.given;
  const auto distance = [&](const ModeCandidate& mode) {
    return std::abs(mode.frequency_hz - frequency_hz);
  };
  const auto nearest = std::ranges::min_element(modes, {}, distance);
  if (nearest == modes.end() || distance(*nearest) > kSameMode * frequency_hz)
    fail_request(
        "no mode at {:.6g} Hz can be removed; that of a suspension belongs to the rigid body",
        frequency_hz);
  const std::string what = fmt::format("removed {:.6g} Hz", nearest->frequency_hz);
  modes.erase(nearest);
  if (modes.empty()) request.modes.kind = Modes::none;
  return {std::move(request), what};
}

Edit set_band(const SortedJson& action, FitRequest request) {
  if (!number_in(action, "low_hz") && !number_in(action, "high_hz")) {
    request.band_hz.reset();
    return {std::move(request), "all lines"};
  }
  const double low_hz = require_number(action, "low_hz", -1e-300, 1e9);
  const double high_hz = require_number(action, "high_hz", low_hz, 1e9);
  const auto rounded = [](double value) { return std::stod(fmt::format("{:.6g}", value)); };
  request.band_hz = {rounded(low_hz), rounded(high_hz)};
  return {std::move(request), fmt::format("band {:.6g} to {:.6g} Hz", low_hz, high_hz)};
}

/// The words of a request. Weights of a file are not among the controls.
FitWords words_of(const FitRequest& request) {
  FitWords words = words_of_flags(flags_of(request));
  if (request.weighting == Weighting::user) words.weighting.clear();
  return words;
}

/// Each control: its key, and its word.
constexpr std::pair<const char*, std::string FitWords::*> kControls[] = {
    {"weighting", &FitWords::weighting},       {"damping", &FitWords::damping},
    {"residue_rank", &FitWords::residue_rank}, {"delay", &FitWords::delay},
    {"rigid_body", &FitWords::rigid_body},     {"direct_term", &FitWords::direct_term}};

/// A count or a search instead of the given modes; not a file.
std::string modes_word(const SortedJson& action) {
  std::string word = text_in(action, "modes");
  const bool number = word.find_first_not_of("0123456789") == std::string::npos && word.size() <= 4;
  if (word != "auto" && !number) fail_request("modes: expected auto or a number of modes");
  return word;
}

Edit refit(const SortedJson& action, FitRequest request) {
  FitWords words = words_of(request);
  std::string what;
  for (const auto& [key, member] : kControls) {
    const auto given = action.find(key);
    if (given == action.end()) continue;
    if (!given->is_string() || given->get_ref<const std::string&>().size() > kLongestWord)
      fail_request("{}: expected a word", key);
    auto word = given->get<std::string>();
    if (member == &FitWords::residue_rank && word.empty()) word = "full";
    if (words.*member == word) continue;
    words.*member = word;
    what += fmt::format("{}{}: {}", what.empty() ? "" : ", ", key, word.empty() ? "default" : word);
  }
  if (!words.weighting.empty() && (!from_word<Weighting>(words.weighting) ||
                                   from_word<Weighting>(words.weighting) == Weighting::user))
    fail_request("weighting: '{}' is unknown", words.weighting);
  words.modes = modes_word(action);
  FitRequest parsed;
  parse_fit_words(words, parsed);
  if (request.weighting != Weighting::user || !words.weighting.empty())
    request.weighting = parsed.weighting;
  request.delay = parsed.delay;
  request.rigid_body = parsed.rigid_body;
  request.residue_rank = parsed.residue_rank;
  request.general_damping = parsed.general_damping;
  request.direct_term = parsed.direct_term;
  if (!words.modes.empty()) {
    request.modes = parsed.modes;
    what += fmt::format("{}modes: {}", what.empty() ? "" : ", ", words.modes);
  }
  return {std::move(request), what.empty() ? "fitted again" : what};
}

}  // namespace

Edit edited(const SortedJson& action, FitRequest request) {
  const std::string kind = text_in(action, "kind");
  if (kind == "add") return add_mode(action, std::move(request));
  if (kind == "remove") return remove_mode(action, std::move(request));
  if (kind == "band") return set_band(action, std::move(request));
  if (kind == "refit") return refit(action, std::move(request));
  fail_request("unknown action");
}

SortedJson controls_json(const FitRequest& request) {
  const FitWords words = words_of(request);
  SortedJson json = {{"band_hz", nullptr}};
  if (request.band_hz) json["band_hz"] = *request.band_hz;
  for (const auto& [key, member] : kControls) json[key] = words.*member;
  return json;
}

}  // namespace stageid
