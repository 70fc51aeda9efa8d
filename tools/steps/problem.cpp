#include "tools/steps/problem.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <functional>
#include <utility>

#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "frf/response/channel_tiles.hpp"
#include "frf/response/confidence.hpp"
#include "frf/response/nonlinearity_sentence.hpp"
#include "frf/response/responding_channels.hpp"
#include "tools/steps/health_step.hpp"

namespace stageid {
namespace {

constexpr const char* kNoise = "noise";
constexpr const char* kOneRealization = "one_realization";
constexpr const char* kDelay = "delay";
constexpr const char* kMissingModes = "missing_modes";

bool is_of_health(const Problem& problem) { return from_word<Cause>(problem.cause).has_value(); }

bool is_end_of_iteration(const Problem& p) {
  return p.is(FitStatus::iteration_limit) || p.is(FitStatus::cost_stalled);
}

/// The ranking: smaller comes first.
int place_of(const Problem& p) {
  const bool unrepeatable = p.cause == to_string(Cause::aperiodic);  // as noise is
  if (p.is(FitStatus::interrupted)) return 0;
  if (p.grave && is_of_health(p) && !unrepeatable) return 1;
  if (p.cause == kNoise) return 2;
  if (p.grave && unrepeatable) return 3;
  if (p.is(FitStatus::faulty_data)) return 4;
  if (p.cause == kDelay) return 5;
  if (p.cause == kLosses) return 6;
  // The residual is compared with them, so that they can be its cause.
  if (is_of_health(p)) return 7;
  if (p.cause == kNonlinear) return 8;
  // A refit has shown that it is the cause. A narrower band avoids what any cause leaves, and a second numerator of every
  // mode imitates much of it.
  const bool fits_any_cause = p.is(FitStatus::undetermined) || p.flags.starts_with("--band") ||
                              p.flags.starts_with("--damping general");
  if (!p.flags.empty() && !fits_any_cause) return 9;
  if (p.cause == kOneRealization) return 10;
  // Modes that the data do not determine also keep the iteration from its end.
  return is_end_of_iteration(p) ? 13 : p.cause == kHeldBack ? 12 : 11;
}

bool explains_others(const Problem& problem) { return place_of(problem) <= 3; }

std::string cause_of(const FitReason& reason) {
  if (reason.status == FitStatus::unexplained && reason.flags.starts_with("--delay")) return kDelay;
  if (reason.status == FitStatus::unexplained && reason.flags.starts_with("--modes"))
    return kMissingModes;
  return to_string(reason.status);
}

/// A response of which no channel exceeds its noise. Of noise alone, 5 % of the lines exceed their 95 % point.
std::vector<Problem> check_noise(const FrfEstimate& frf) {
  const bool noise = frf.noise_variance.size() > 0;
  const Eigen::MatrixXd& variance = noise ? frf.noise_variance : frf.total_variance;
  if (variance.size() == 0 || frf.any(responding_channels(frf).any())) return {};
  const double limit = squared_error_quantile(0.95, noise ? frf.noise_dof : frf.total_dof);
  const auto [first, count] = frf.own();
  const auto power = frf.response.middleRows(first, count).cwiseAbs2().array();
  Eigen::MatrixXd above(frf.response.rows(), 1);  // lines of every channel
  above.middleRows(first, count) =
      (power > limit * variance.middleRows(first, count).array()).rowwise().count().cast<double>();
  frf.team->gather_rows(kTileChannels, above);
  const double share = above.maxCoeff() / static_cast<double>(frf.lines());
  return {
      {kNoise, false,
       fmt::format("the response is not above its noise: {:.0f} % of the lines of the best channel "
                   "are above its 95 % limit, and noise alone gives 5 %",
                   100.0 * share),
       "raise 'level' in the experiment file as far as the stage permits, or measure more "
       "periods"}};
}

/// Faults and noise of the data explain all that follows, and noise alone also that nothing repeats. Any other grave
/// problem may keep the iteration from its end, so more iterations are not advised beside it.
std::size_t in_head(const std::vector<Problem>& problems) {
  if (!problems.empty() && problems.front().cause == kNoise) return 1;
  const auto last = std::ranges::find_if(problems, std::not_fn(explains_others));
  if (last != problems.begin())
    return std::min(static_cast<std::size_t>(last - problems.begin()), kMostInHead);
  const auto end = std::ranges::find_if(problems, is_end_of_iteration);
  const bool of_others = std::any_of(problems.begin(), end, std::mem_fn(&Problem::grave));
  const auto count = of_others ? static_cast<std::size_t>(end - problems.begin()) : problems.size();
  return std::min(count, kMostInHead);
}

std::string capitalized(std::string text) {
  // A flag or key at the beginning is not a word.
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text;
}

}  // namespace

std::string Problem::text() const {
  return remedy.empty() ? what : what + ". " + capitalized(remedy);
}

void rank(std::vector<Problem>& problems) {
  std::ranges::stable_sort(problems, {}, place_of);
  std::vector<Problem> kept;
  for (Problem& p : problems) {
    const auto same = [&](const Problem& other) {
      return other.what.find(p.what) != std::string::npos;
    };
    if (std::ranges::none_of(kept, same)) kept.push_back(std::move(p));
  }
  problems = std::move(kept);
}

bool explain_the_rest(const std::vector<Problem>& problems) {
  return !problems.empty() && explains_others(problems.front());
}

std::vector<Problem> problems_of(const std::vector<Finding>& health) {
  std::vector<Problem> problems;
  for (const Finding& f : health) {
    if (f.severity == Severity::unchecked) continue;
    problems.push_back({to_string(f.cause), f.severity == Severity::fault,
                        fmt::format("{}{}{}{}", f.channel, f.channel.empty() ? "" : ": ", f.what,
                                    f.what.ends_with(f.figure) ? "" : " (" + f.figure + ")"),
                        f.remedy});
  }
  return problems;
}

std::vector<Problem> problems_of(const FrfEstimate& frf) {
  std::vector<Problem> problems = problems_of(health_of(frf.provenance_json));
  for (Problem& noise : check_noise(frf)) problems.push_back(std::move(noise));
  if (std::string what = nonlinearity_sentence(frf); !what.empty())
    problems.push_back(
        {kNonlinear, false, std::move(what),
         "the model is the best linear one at this level, and its standard deviations "
         "include the distortion. For less of it, halve 'level' in the experiment "
         "file"});
  if (frf.realizations == 1)
    problems.push_back(
        {kOneRealization, false,
         "one realization was measured: its distortion cannot be separated from noise "
         "and resonances",
         "set 'realizations' to 3 or more in the experiment file, and measure again"});
  return problems;
}

std::vector<Problem> problems_of(const AdditiveModel& model) {
  std::vector<Problem> problems;
  for (const Json& one : list_in(parse_json<Json>(model.provenance_json), "problems"))
    problems.push_back({text_in(one, "cause"), one.contains("grave") && one["grave"] == true,
                        text_in(one, "what"), text_in(one, "remedy")});
  for (const FitReason& reason : model.fit.why())
    problems.push_back({cause_of(reason), true, reason.what,
                        reason.remedy.empty() && reason.status == FitStatus::iteration_limit
                            ? "allow more iterations"
                            : reason.remedy,
                        reason.flags});
  return problems;
}

std::vector<std::string> head_lines(std::string prefix, const std::vector<Problem>& problems) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < in_head(problems); ++i) {
    const Problem& p = problems[i];
    lines.push_back((i == 0 ? std::move(prefix) : "also: ") + p.text() +
                    (p.command.empty() ? "" : ":"));
    if (!p.command.empty()) lines.push_back("    " + p.command);
  }
  if (lines.empty() && !prefix.empty()) lines.push_back(std::move(prefix));
  return lines;
}

void warn_of(const std::vector<Problem>& problems, const std::filesystem::path& file,
             const Console& console) {
  const std::vector<std::string> lines =
      head_lines(file.string() + ": not to be trusted: ", problems);
  console.warning(lines.front());
  for (std::size_t i = 1; i < lines.size(); ++i) console.message(lines[i]);
}

Json head_json(const std::vector<Problem>& problems) {
  Json json = {{"head", Json::array()}, {"reasons", Json::array()}};
  for (const Problem& p : problems) {
    json["reasons"].push_back(p.text());
    if (json["head"].size() < in_head(problems))
      json["head"].push_back(
          {{"cause", p.cause}, {"what", p.what}, {"remedy", p.remedy}, {"command", p.command}});
  }
  return json;
}

Json stored(const std::vector<Problem>& problems) {
  Json json = Json::array();
  for (const Problem& p : problems)
    json.push_back(
        {{"cause", p.cause}, {"grave", p.grave}, {"what", p.what}, {"remedy", p.remedy}});
  return json;
}

}  // namespace stageid
