#include "tools/steps/problem_commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <sstream>
#include <string_view>
#include <utility>

#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "estimation/request/fit_request.hpp"
#include "tools/terminal/shell_word.hpp"

namespace stageid {
namespace {

using Path = std::filesystem::path;

constexpr double kMoreIterations = 4.0;  // times those of the fit

std::string in_shell(const std::string& word) {
  const auto is_plain = [](unsigned char c) {
    return std::isalnum(c) != 0 ||
           std::string_view("_./,:=+-@%").find(static_cast<char>(c)) != std::string_view::npos;
  };
  if (!word.empty() && std::ranges::all_of(word, is_plain)) return word;
  return shell_word(word);
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

/// The lines of `fit` in an experiment file that say the same as flags: "'modes: auto'".
std::string keys_of(const std::string& flags) {
  std::vector<std::string> lines;
  std::istringstream words(flags);
  for (std::string word; words >> word;) {
    if (!word.starts_with("--")) {
      lines.back() += (lines.back().ends_with(":") ? " " : ", ") + word;
      continue;
    }
    std::ranges::replace(word, '-', '_');
    const std::string key = word.substr(2);
    lines.push_back(key + (key == "delay" ? "_s:" : key == "band" ? "_hz:" : ":"));
  }
  for (std::string& line : lines) {
    if (const std::size_t value = line.find(": "); line.find(", ") != std::string::npos)
      line = fmt::format("{}[{}]", line.substr(0, value + 2), line.substr(value + 2));
    line = fmt::format("'{}'", line);
  }
  return fmt::format("{}", fmt::join(lines, " and "));
}

/// Builds the commands of one result.
class Commands {
 public:
  Commands(ResultFiles files, const Json& frf, const AdditiveModel* model)
      : files_(std::move(files)), frf_(frf), model_(model) {
    if (model != nullptr) {
      fit_ = parse_json_object<Json>(model->provenance_json);
      const Json inputs = list_in(fit_, "inputs");
      if (files_.frf.empty() && !inputs.empty())
        files_.frf = beside(files_, text_in(inputs[0], "file"));
    }
    if (files_.log.empty()) files_.log = beside(files_, log_name());
  }

  void add(Problem& p) const {
    const auto cause = from_word<Cause>(p.cause);
    if (!p.flags.empty())
      refit(p, p.flags);
    else if (p.is(FitStatus::iteration_limit))
      refit(p, fmt::format("--max-iterations {:.0f}", kMoreIterations * iterations()));
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
    const Json logs = list_in(frf_, "logs");
    return !logs.empty() && logs[0].is_string() ? logs[0].get<std::string>() : "";
  }

  std::string experiment_name() const {
    const Json experiments = list_in(frf_, "experiments");
    return experiments.empty() ? "" : text_in(experiments[0], "configuration_file");
  }

  double iterations() const {
    return number_in(fit_.value("options", Json()), "max_iterations")
        .value_or(FitRequest().max_iterations);
  }

  void refit(Problem& p, const std::string& flags) const {
    p.command = refit(flags);
    if (p.command.empty() || files_.experiment.empty()) return;
    if (!p.remedy.empty()) p.remedy += "; ";
    p.remedy += fmt::format("for later measurements, write {} under 'fit' in {}", keys_of(flags),
                            files_.experiment.string());
  }

  std::string refit(const std::string& flags) const {
    if (files_.frf.empty() || files_.model.empty()) return {};
    const Json options = fit_.value("options", Json());
    const Json asked = options.contains("flags") ? options["flags"] : Json::object();
    return fit_command_line(files_.frf, files_.model, asked, flags);
  }

  std::string estimate(const std::string& flags) const {
    if (files_.log.empty() || files_.frf.empty()) return {};
    std::vector<int> realizations;  // counted from 1
    for (const Json& one : list_in(frf_, "realizations"))
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
  Json fit_ = Json::object();
};

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

}  // namespace

std::string fit_command_line(const Path& frf, const Path& model, const Json& flags,
                             const std::string& changed) {
  return fmt::format("stageid fit {} -o {}{}", in_shell(frf), in_shell(model),
                     refit_flags(flags, changed));
}

void add_commands(std::vector<Problem>& problems, ResultFiles files,
                  const std::string& frf_provenance_json, const AdditiveModel* model) {
  add_all_commands(problems, std::move(files), parse_json_object<Json>(frf_provenance_json), model);
}

void add_commands(std::vector<Problem>& problems, ResultFiles files, const AdditiveModel& model) {
  const Json json = parse_json_object<Json>(model.provenance_json);
  add_all_commands(problems, std::move(files),
                   json.contains("frf") && json["frf"].is_object() ? json["frf"] : Json::object(),
                   &model);
}

}  // namespace stageid
