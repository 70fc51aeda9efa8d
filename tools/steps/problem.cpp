#include "tools/steps/problem.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <sstream>
#include <string_view>
#include <utility>

#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "estimation/request/fit_request.hpp"
#include "frf/response/confidence.hpp"
#include "frf/response/nonlinearity_sentence.hpp"
#include "frf/response/responding_channels.hpp"
#include "tools/steps/health_step.hpp"

namespace stageid {
namespace {

using Json = nlohmann::ordered_json;
using Path = std::filesystem::path;

constexpr double kMoreIterations = 4.0;  // times those of the fit

constexpr const char* kNoise = "noise";
constexpr const char* kNonlinear = "nonlinear";
constexpr const char* kOneRealization = "one_realization";
constexpr const char* kDelay = "delay";
constexpr const char* kMissingModes = "missing_modes";

bool is(const Problem& problem, FitStatus status) { return problem.cause == to_string(status); }

bool is_of_health(const Problem& problem) { return from_word<Cause>(problem.cause).has_value(); }

/// The ranking: smaller comes first.
int place_of(const Problem& p) {
  const bool unrepeatable = p.cause == to_string(Cause::aperiodic);  // as noise is
  if (is(p, FitStatus::interrupted)) return 0;
  if (p.grave && is_of_health(p) && !unrepeatable) return 1;
  if (p.cause == kNoise) return 2;
  if (p.grave && unrepeatable) return 3;
  if (is(p, FitStatus::faulty_data)) return 4;
  if (p.cause == kDelay) return 5;
  if (p.cause == kLosses) return 6;
  // The residual is compared with them, so that they can be its cause.
  if (is_of_health(p)) return 7;
  if (p.cause == kNonlinear) return 8;
  // A refit has shown that it is the cause. A narrower band avoids what any cause leaves.
  const bool avoids = is(p, FitStatus::undetermined) || p.flags.starts_with("--band");
  if (!p.flags.empty() && !avoids) return 9;
  if (p.cause == kOneRealization) return 10;
  return p.cause == kHeldBack ? 12 : 11;
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
  if (variance.size() == 0 || responding_channels(frf).any()) return {};
  const double limit = squared_error_quantile(0.95, noise ? frf.noise_dof : frf.total_dof);
  const auto above =
      (frf.response.cwiseAbs2().array() > limit * variance.array()).rowwise().count();
  const double share = static_cast<double>(above.maxCoeff()) / static_cast<double>(frf.lines());
  return {
      {kNoise, false,
       fmt::format("the response is not above its noise: {:.0f} % of the lines of the best channel "
                   "exceed it, and noise alone gives 5 %",
                   100.0 * share),
       "raise 'level' in the experiment file, or measure more periods"}};
}

std::string in_shell(const std::string& word) {
  const auto is_plain = [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("_./,:=+-@%").find(static_cast<char>(c)) != std::string_view::npos;
  };
  if (!word.empty() && std::ranges::all_of(word, is_plain)) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}
std::string in_shell(const Path& path) { return in_shell(path.string()); }

/// " a b": each word of a text, because files of others contain it.
std::string words_in_shell(const std::string& text) {
  std::string out;
  std::istringstream words(text);
  for (std::string word; words >> word;) out.append(1, ' ').append(in_shell(word));
  return out;
}

/// A file that a provenance names, in the folder of one of the others, or in the current one; empty: not there.
Path beside(const ResultFiles& files, const std::string& name) {
  if (name.empty()) return {};
  std::error_code none;
  for (const Path& other : {files.frf, files.model, files.log, Path(".")})
    if (const Path path = (other.parent_path() / name).lexically_normal();
        !other.empty() && std::filesystem::exists(path, none))
      return path;
  return {};
}

/// The flags of a fit, `changed` instead of those of the same name.
std::string refit_flags(const Json& asked, const std::string& changed) {
  std::string text;
  for (const auto& [flag, value] : asked.items()) {
    if ((" " + changed + " ").find(" " + flag + " ") != std::string::npos) continue;
    for (const Json& one : value.is_array() ? value : Json::array({value}))
      if (one.is_string()) {
        const auto words = one.get<std::string>();
        text += fmt::format(
            " {}{}", in_shell(flag),
            flag == "--band" ? words_in_shell(words) : fmt::format(" {}", in_shell(words)));
      }
  }
  return text + words_in_shell(changed);
}

/// Builds the commands of one result.
class Commands {
 public:
  Commands(ResultFiles files, const Json& frf, const AdditiveModel* model)
      : files_(std::move(files)), frf_(frf), model_(model) {
    if (model != nullptr) {
      fit_ = parse_json<Json>(model->provenance_json);
      if (!fit_.is_object()) fit_ = Json::object();
      if (files_.frf.empty() && fit_.contains("inputs") && fit_["inputs"].is_array() &&
          !fit_["inputs"].empty())
        files_.frf = beside(files_, text_in(fit_["inputs"][0], "file"));
    }
    if (files_.log.empty()) files_.log = beside(files_, log_name());
  }

  void add(Problem& p) const {
    const auto cause = from_word<Cause>(p.cause);
    if (!p.flags.empty())
      p.command = refit(p.flags);
    else if (is(p, FitStatus::iteration_limit))
      p.command = refit(fmt::format("--max-iterations {:.0f}", kMoreIterations * iterations()));
    else if (from_word<FitStatus>(p.cause))
      return;  // no remedy is known
    else if (p.cause == kNonlinear && model_ != nullptr &&
             model_->fit.weighting == "noise_variance")
      p.command = refit("--weighting total_variance");
    else if (cause == Cause::unsettled)
      p.command = estimate("--method lpm");
    else
      again(p);
  }

 private:
  std::string log_name() const {
    if (!frf_.contains("logs") || !frf_["logs"].is_array() || frf_["logs"].empty()) return {};
    return frf_["logs"][0].is_string() ? frf_["logs"][0].get<std::string>() : "";
  }

  std::string experiment_name() const {
    if (!frf_.contains("experiments") || !frf_["experiments"].is_array() ||
        frf_["experiments"].empty())
      return {};
    return text_in(frf_["experiments"][0], "configuration_file");
  }

  double iterations() const {
    const auto options = fit_.find("options");
    return options == fit_.end()
               ? FitRequest().max_iterations
               : number_in(*options, "max_iterations").value_or(FitRequest().max_iterations);
  }

  std::string refit(const std::string& flags) const {
    if (files_.frf.empty() || files_.model.empty()) return {};
    const auto options = fit_.find("options");
    const Json asked =
        options != fit_.end() && options->contains("flags") ? (*options)["flags"] : Json::object();
    return fmt::format("stageid fit {} -o {}{}", in_shell(files_.frf), in_shell(files_.model),
                       refit_flags(asked, flags));
  }

  std::string estimate(const std::string& flags) const {
    if (files_.log.empty() || files_.frf.empty()) return {};
    std::vector<int> realizations;  // counted from 1
    if (frf_.contains("realizations") && frf_["realizations"].is_array())
      for (const Json& one : frf_["realizations"])
        if (one.is_number_integer()) realizations.push_back(one.get<int>() + 1);
    const std::string some =
        realizations.empty() ? "" : fmt::format(" --realizations {}", fmt::join(realizations, ","));
    return fmt::format("stageid frf {} -o {}{} {}", in_shell(files_.log), in_shell(files_.frf),
                       some, flags);
  }

  /// What follows a repair, unless the remedy says so already.
  void again(Problem& p) const {
    p.command = measure();
    if (p.command.starts_with("stageid log"))
      p.remedy += "; then check the log";
    else if (!p.command.empty() && p.remedy.find("measure") == std::string::npos)
      p.remedy += "; then measure again";
  }

  /// A new measurement; without its experiment file, the check of the log.
  std::string measure() const {
    const Path run = beside(files_, experiment_name());
    if (!files_.experiment.empty())
      return fmt::format("stageid identify {} -o {}", in_shell(files_.experiment),
                         in_shell(files_.directory.string() + "_again"));
    if (!run.empty())
      return fmt::format("stageid run {} -o {}_again.slog", in_shell(run),
                         in_shell(run.parent_path() / run.stem()));
    return files_.log.empty() ? ""
                              : fmt::format("stageid log info {} --health", in_shell(files_.log));
  }

  ResultFiles files_;
  const Json& frf_;
  const AdditiveModel* model_;
  Json fit_;
};

Json object_of(const std::string& text) {
  Json json = parse_json<Json>(text);
  return json.is_object() ? json : Json::object();
}

void add_all_commands(std::vector<Problem>& problems, ResultFiles files, const Json& frf,
                      const AdditiveModel* model) {
  const Commands commands(std::move(files), frf, model);
  for (auto p = problems.begin(); p != problems.end(); ++p) {
    commands.add(*p);
    if (std::find_if(problems.begin(), p,
                     [&](const Problem& before) { return before.command == p->command; }) != p)
      p->command.clear();  // once is enough
  }
}

/// Faults and noise of the data explain all that follows.
std::size_t in_head(const std::vector<Problem>& problems) {
  const auto last = std::ranges::find_if(problems, std::not_fn(explains_others));
  const auto count = last == problems.begin() ? problems.size()
                                              : static_cast<std::size_t>(last - problems.begin());
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

std::vector<Problem> problems_of(const std::vector<Finding>& health) {
  std::vector<Problem> problems;
  for (const Finding& f : health) {
    if (f.severity == Severity::unchecked) continue;
    problems.push_back({to_string(f.cause), f.severity == Severity::fault,
                        fmt::format("{}{}{}{}", f.channel, f.channel.empty() ? "" : ": ", f.what,
                                    f.figure.empty() ? "" : " (" + f.figure + ")"),
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
         "include the distortion. For less of it, lower 'level' in the experiment "
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
  const Json json = object_of(model.provenance_json);
  if (json.contains("problems") && json["problems"].is_array())
    for (const Json& one : json["problems"])
      problems.push_back({text_in(one, "cause"),
                          one.is_object() && one.contains("grave") && one["grave"] == true,
                          text_in(one, "what"), text_in(one, "remedy")});
  for (const FitReason& reason : model.fit.why())
    problems.push_back({cause_of(reason), true, reason.what,
                        reason.remedy.empty() && reason.status == FitStatus::iteration_limit
                            ? "allow more iterations"
                            : reason.remedy,
                        reason.flags});
  return problems;
}

void add_commands(std::vector<Problem>& problems, ResultFiles files,
                  const std::string& frf_provenance_json, const AdditiveModel* model) {
  add_all_commands(problems, std::move(files), object_of(frf_provenance_json), model);
}

void add_commands(std::vector<Problem>& problems, ResultFiles files, const AdditiveModel& model) {
  const Json json = object_of(model.provenance_json);
  add_all_commands(problems, std::move(files),
                   json.contains("frf") && json["frf"].is_object() ? json["frf"] : Json::object(),
                   &model);
}

std::vector<std::string> head_lines(std::string prefix, const std::vector<Problem>& problems) {
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < in_head(problems); ++i) {
    const Problem& p = problems[i];
    const std::string number = i == 0 ? std::move(prefix) : fmt::format("{}. ", i + 1);
    lines.push_back(number + p.text() + (p.command.empty() ? "" : ":"));
    if (!p.command.empty()) lines.push_back("    " + p.command);
  }
  if (lines.empty() && !prefix.empty()) lines.push_back(std::move(prefix));
  return lines;
}

void warn_of(const std::vector<Problem>& problems, const Path& file, const Console& console) {
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
