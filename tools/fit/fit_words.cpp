#include "tools/fit/fit_words.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string_view>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/key_suggestion.hpp"
#include "estimation/request/submodel_text.hpp"
#include "tools/fit/flag_values.hpp"
#include "tools/terminal/text_lines.hpp"

namespace stageid {
namespace {

constexpr std::string_view kSuspension = "suspension";
constexpr const char* kRigidBodies =
    "auto, none, full, a rank of 1 or more, suspension, or suspension:F1:F2 (Hz)";

int parse_rank(const char* flag, const std::string& text, const char* expected) {
  const std::optional<double> number = parse_number(text);
  if (!number || *number < 1.0 || *number > 1000.0 || std::floor(*number) != *number)
    refuse(flag, text, expected);
  return static_cast<int>(*number);
}

/// "f1,f2:zeta2,...": frequencies in Hz, each with its damping ratio if that is given.
std::vector<ModeCandidate> parse_frequencies(const std::string& text) {
  std::vector<ModeCandidate> modes;
  std::string_view rest = text;
  while (!rest.empty()) {
    const std::string_view one = rest.substr(0, rest.find(','));
    const std::size_t colon = std::min(one.find(':'), one.size());
    const std::optional<double> frequency_hz = parse_number(one.substr(0, colon));
    const std::optional<double> damping_ratio =
        colon < one.size() ? parse_number(one.substr(colon + 1)) : ModeCandidate{}.damping_ratio;
    if (!frequency_hz || *frequency_hz <= 0.0 || !damping_ratio || *damping_ratio <= 0.0 ||
        *damping_ratio >= 1.0)
      refuse("--modes", text,
             "auto, none, a number of modes, frequencies in Hz 'f1,f2,...', the same with damping "
             "ratios 'f1:0.01,...', or a file");
    modes.push_back({*frequency_hz, *damping_ratio});
    rest.remove_prefix(std::min(one.size() + 1, rest.size()));
  }
  std::ranges::stable_sort(
      modes, [](const auto& a, const auto& b) { return a.frequency_hz < b.frequency_hz; });
  return modes;
}

ModesRequest parse_modes(const std::string& text) {
  using Kind = ModesRequest::Kind;
  if (text.empty()) return {};
  if (text == "auto") return {Kind::search, 0, {}};
  if (text == "none") return {Kind::none, 0, {}};
  if (text.find(',') != std::string::npos) return {Kind::given, 0, parse_frequencies(text)};
  const std::optional<double> number = parse_number(text);
  if (number && text.find_first_of(".eEdD") == std::string::npos) {
    if (*number < 1.0 || *number > 1000.0) refuse("--modes", text, "1 to 1000 modes");
    return {Kind::count, static_cast<int>(*number), {}};
  }
  if (number || text.find_first_not_of("0123456789.eE+-:") == std::string::npos)
    return {Kind::given, 0, parse_frequencies(text)};
  if (!std::filesystem::exists(text))
    throw FileError(
        fmt::format("--modes: '{}': no such file; use auto, none, a number of modes, "
                    "frequencies in Hz 'f1,f2,...', or the name of an existing file",
                    text));
  return {Kind::given, 0, read_modes(text)};
}

void parse_weighting(const std::string& text, FitRequest& request) {
  if (text.empty()) return;
  const std::vector<std::string> offered = words_before(Weighting::user);
  if (const auto weighting = from_word<Weighting>(text);
      weighting && *weighting != Weighting::user) {
    request.weighting = *weighting;
    return;
  }
  if (text.find('.') == std::string::npos && text.find('/') == std::string::npos)
    refuse("--weighting", text,
           fmt::format("{}, or the name of an HDF5 file with /weights or /weight_matrices{}",
                       fmt::join(offered, ", "), nearest_hint(text, offered)));
  request.weighting = Weighting::user;
  request.weight_file = text;
}

DelayRequest parse_delay(const std::string& text) {
  if (const auto model = from_word<DelayModel>(text); model && *model != DelayModel::fixed)
    return {*model, 0.0};
  const std::optional<double> delay_s = parse_number(text);
  if (!delay_s) refuse("--delay", text, "a number in s, estimate or per_channel");
  return {DelayModel::fixed, *delay_s};
}

std::vector<double> parse_suspension(const std::string& text) {
  std::vector<double> frequencies_hz;
  std::string_view rest = std::string_view(text).substr(kSuspension.size());
  while (!rest.empty()) {
    const std::size_t colon = rest[0] == ':' ? std::min(rest.find(':', 1), rest.size()) : 0;
    const std::optional<double> frequency_hz =
        colon > 0 ? parse_number(rest.substr(1, colon - 1)) : std::nullopt;
    if (!frequency_hz || *frequency_hz <= 0.0)
      refuse("--rigid-body", text, "suspension, or suspension:F1:F2 with known frequencies in Hz");
    frequencies_hz.push_back(*frequency_hz);
    rest.remove_prefix(colon);
  }
  return frequencies_hz;
}

RigidBodyRequest parse_rigid_body(const std::string& text) {
  using Kind = RigidBodyRequest::Kind;
  if (text.empty()) return {};
  if (text.starts_with(kSuspension)) return {Kind::suspension, 0, parse_suspension(text)};
  if (const auto kind = from_word<Kind>(text); kind && *kind != Kind::by_submodels) return {*kind};
  const std::string hint =
      nearest_hint(text.substr(0, text.find(':')), words_before(Kind::by_submodels));
  if (!parse_number(text) && !hint.empty()) refuse("--rigid-body", text, kRigidBodies + hint);
  return {Kind::free, parse_rank("--rigid-body", text, kRigidBodies)};
}

/// Whether the word is the second of the two. @throws as refuse_word()
bool is_second(const char* flag, const std::string& word, const std::vector<std::string>& two) {
  if (word != two[0] && word != two[1]) refuse_word(flag, word, two);
  return word == two[1];
}

}  // namespace

void parse_fit_words(const FitWords& flags, FitRequest& request) {
  request.modes = parse_modes(flags.modes);
  parse_weighting(flags.weighting, request);
  if (!flags.hold.empty()) request.hold = pick<HoldModel>("--hold", flags.hold);
  if (!flags.delay.empty()) request.delay = parse_delay(flags.delay);
  request.rigid_body = parse_rigid_body(flags.rigid_body);
  request.residue_rank =
      flags.residue_rank == "full"
          ? 0
          : parse_rank("--residue-rank", flags.residue_rank, "full or a rank of 1 or more");
  if (!flags.damping.empty())
    request.general_damping = is_second("--damping", flags.damping, {"proportional", "general"});
  if (!flags.direct_term.empty())
    request.direct_term = is_second("--direct-term", flags.direct_term, {"none", "full"});
  request.method = pick<FitMethod>("--method", flags.method);
  for (const std::string& text : flags.submodels) request.submodels.push_back(parse_submodel(text));
}

}  // namespace stageid
