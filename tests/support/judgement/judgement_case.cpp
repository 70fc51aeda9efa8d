#include "tests/support/judgement/judgement_case.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/resource.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <ranges>
#include <utility>

#include "acquisition/files/json_members.hpp"
#include "acquisition/formats/convert_log.hpp"
#include "estimation/modal/validation.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/distortion_variance.hpp"
#include "tests/support/process/file_bytes.hpp"
#include "tests/support/process/run_program.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tools/steps/truth_comparison.hpp"

namespace stageid::test {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMostHalvings = 6;  // of a nonlinearity that makes the loop unstable

/// NaN where JSON has null.
double number(const Json& object, const char* key) {
  return number_in(object, key).value_or(std::numeric_limits<double>::quiet_NaN());
}

double children_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_CHILDREN, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// One command of the program, with its output.
struct Command {
  ProgramResult ran;
  Json json = Json::object();
};

class Session {
 public:
  explicit Session(std::filesystem::path program) : program_(std::move(program)) {}

  Command run(std::vector<std::string> words) {
    words.insert(words.begin(), "--json");
    words.insert(words.end(), {"--threads", "1"});
    const double before = children_seconds();
    Command command{stageid::test::run_program(program_, words), Json::object()};
    seconds_ += children_seconds() - before;
    const Json parsed = Json::parse(command.ran.out, nullptr, false);
    if (parsed.is_object()) command.json = parsed;
    return command;
  }
  double seconds() const { return seconds_; }

 private:
  std::filesystem::path program_;
  double seconds_ = 0.0;
};

std::string last_line(const std::string& text) {
  std::size_t end = text.find_last_not_of('\n');
  if (end == std::string::npos) return "";
  const std::size_t begin = text.rfind('\n', end);
  return text.substr(begin == std::string::npos ? 0 : begin + 1, end - begin);
}

/// The plant that the fitted realizations saw on average.
SimulatedSpec plant_of(const JudgementStage& stage, const TroublePlan& plan) {
  SimulatedSpec spec = stage.spec;
  if (plan.drifting_mode >= 0)
    spec.plant.in_plane_modes[plan.drifting_mode].natural_frequency_hz *=
        1.0 - 0.5 * plan.drift_relative / stage.realizations;
  if (plan.swapped[0] >= 0 && !stage.stage_file) {
    // Only a stage file could reveal it; the expected answer uses the names in the log.
    const auto a = static_cast<std::size_t>(plan.swapped[0]);
    const auto b = static_cast<std::size_t>(plan.swapped[1]);
    std::swap(spec.info.sensors[a], spec.info.sensors[b]);
    std::swap(spec.info.sensors[a].name, spec.info.sensors[b].name);
    for (PlantMode& mode : spec.plant.in_plane_modes)
      std::swap(mode.sensor_shape[plan.swapped[0]], mode.sensor_shape[plan.swapped[1]]);
  }
  return spec;
}

/// Response of the plant with its trouble as a flawless measurement records it, (n_y n_u) x N in the order of `frf`.
Eigen::MatrixXcd exact_response(const JudgementStage& stage, const TroublePlan& plan,
                                const FrfEstimate& frf) {
  const SimulatedSpec spec = plant_of(stage, plan);
  const std::vector<PlantMode> modes = plant_modes(spec.info, spec.plant);
  const bool nonlinear = plan.cubic_n_m3 > 0.0 || plan.friction_n > 0.0;
  const Eigen::MatrixXcd average =
      nonlinear ? best_linear_approximation(stage, plan) : Eigen::MatrixXcd();
  const Eigen::VectorXd grid_hz = stage.plan().grid().frequency_hz();
  const auto n_y = static_cast<Eigen::Index>(spec.info.sensors.size());
  Eigen::MatrixXcd exact(frf.response.rows(), frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    Eigen::MatrixXcd G =
        sampled_response(modes, spec.info.delay_s, spec.info.sample_rate_hz, frf.frequency_hz[k]);
    if (nonlinear) {
      Eigen::Index at = 0;
      (grid_hz.array() - frf.frequency_hz[k]).abs().minCoeff(&at);
      G = average.col(at).reshaped(n_y, G.cols());
    }
    if (plan.late >= 0) {
      const std::complex<double> turn =
          std::polar(1.0, -2.0 * std::numbers::pi * frf.frequency_hz[k] * plan.late_samples /
                              spec.info.sample_rate_hz);
      if (plan.late_sensor)
        G.row(plan.late) *= turn;
      else
        G.col(plan.late) /= turn;
    }
    for (Eigen::Index c = 0; c < exact.rows(); ++c)
      exact(c, k) = G(channel_index(spec.info.sensors, frf.outputs.names[c % frf.n_outputs()]),
                      channel_index(spec.info.actuators, frf.inputs.names[c / frf.n_outputs()]));
  }
  return exact;
}

/// Squared error of the model over that of the measured response, weighed by the variances of noise and distortion.
double excess_of(const AdditiveModel& model, const FrfEstimate& frf,
                 const Eigen::MatrixXcd& exact) {
  if (frf.noise_variance.size() == 0) return 0.0;
  const Eigen::MatrixXd variance =
      frf.total_dof >= 1.0 ? distortion_variance(frf).variance : frf.noise_variance;
  const auto size = [&](const Eigen::MatrixXcd& G) {
    return ((G - exact).cwiseAbs2().array() / variance.array()).sum();
  };
  return size(response_like(model, frf)) / size(frf.response);
}

void compare(const AdditiveModel& model, const FrfEstimate& frf, const JudgementStage& stage,
             const TroublePlan& plan, Json& result) {
  const SimulatedSpec spec = plant_of(stage, plan);
  const TruthComparison truth = compare_with_truth(model, frf, spec.info, spec.plant);
  Json df = Json::array();
  Json dz = Json::array();
  int found = 0;
  for (const ModeRow& mode : truth.modes) {
    if (mode.frequency_hz) ++found;
    if (const auto deviation = mode.frequency_deviation()) df.push_back(*deviation);
    if (const auto deviation = mode.damping_deviation()) dz.push_back(*deviation);
  }
  result["true_modes"] = truth.modes.size();
  result["found"] = found;
  result["extra"] = truth.extra_hz;
  if (model.input_delay_std_s.size() > 0 && model.input_delay_std_s[0] > 0.0)
    result["delay_deviation"] =
        (model.input_delays_s()[0] - spec.info.delay_s) / model.input_delay_std_s[0];

  result["df"] = std::move(df);
  result["dz"] = std::move(dz);
  result["relative_error"] = truth.relative_rms_error;
  result["excess"] = excess_of(model, frf, exact_response(stage, plan, frf));
}

/// The first reason of a verdict; without one, the last line of the messages.
std::string first_reason(const Command& command) {
  if (command.json.contains("reasons") && !command.json["reasons"].empty())
    return command.json["reasons"][0];
  return last_line(command.ran.err);
}

/// The first cause in the output for exit code 3: the finding of an untrustworthy log, then the first reason of the fit,
/// then that of the validation.
std::string first_cause(const Command& frf, const Command& fit, const Command& validation) {
  if (frf.ran.exit_code != 0) {
    if (frf.json.contains("health"))
      for (const Json& finding : frf.json["health"])
        if (finding["severity"] == "fault") return finding["cause"];
    return last_line(frf.ran.err);
  }
  if (fit.ran.exit_code != 0) return first_reason(fit);
  return validation.ran.exit_code == 0 ? "" : first_reason(validation);
}

bool names_any(std::string said, const std::vector<std::string>& causes) {
  std::transform(said.begin(), said.end(), said.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::any_of(causes.begin(), causes.end(), [&](const std::string& cause) {
    return said.find(cause) != std::string::npos;
  });
}

void run_steps(const JudgementStage& stage, const TroublePlan& plan, Session& session,
               const std::filesystem::path& directory, Json& result) {
  const auto path = [&](const char* name) { return (directory / name).string(); };
  convert_log(measure_with_trouble(stage, plan), directory / "log.h5");
  std::vector<std::string> words = {
      "frf",
      path("log.h5"),
      "-o",
      path("frf.h5"),
      "--realizations",
      fmt::format("{}", fmt::join(std::views::iota(1, stage.realizations), ","))};
  if (stage.stage_file) {
    write_bytes(directory / "stage.yaml", stage.nominal_text());
    words.insert(words.end(), {"--stage", path("stage.yaml")});
  }
  const Command frf = session.run(words);
  Command fit;
  Command validation;
  fit.ran.exit_code = validation.ran.exit_code = 0;
  if (frf.ran.exit_code == 0 || frf.ran.exit_code == 3)
    fit = session.run({"fit", path("frf.h5"), "-o", path("model.json")});
  const bool fitted = std::filesystem::exists(directory / "model.json");
  Command held_back;
  if (fitted) {
    held_back = session.run({"frf", path("log.h5"), "-o", path("held_back.h5"), "--no-health",
                             "--realizations", fmt::format("{}", stage.realizations)});
    validation = session.run({"validate", path("model.json"), path("held_back.h5")});
  }
  const int worst = std::max({frf.ran.exit_code, fit.ran.exit_code, validation.ran.exit_code});
  result["exit"] = worst;
  result["exits"] = {frf.ran.exit_code, fit.ran.exit_code, validation.ran.exit_code};
  result["said"] = first_cause(frf, fit, validation);
  result["right"] = worst != 0 && names_any(result["said"], plan.right_causes);
  Json findings = Json::array();
  if (frf.json.contains("health"))
    for (const Json& f : frf.json["health"])
      if (f["severity"] != "not checked")
        findings.push_back(fmt::format("{} {} {}: {}", std::string(f["severity"]),
                                       std::string(f["cause"]), std::string(f["channel"]),
                                       std::string(f["figure"])));
  result["findings"] = std::move(findings);
  result["message"] = fit.json.value("message", last_line(fit.ran.err));
  result["nonlinear"] =
      frf.json.contains("nonlinearity") && frf.json["nonlinearity"].value("nonlinear", false);
  if (validation.json.contains("frequency_domain"))
    result["chi_square"] = number(validation.json["frequency_domain"], "chi_square_per_dof");
  result["dropped"] = 0;
  for (const char* list : {"dropped_periods", "replaced_samples"})
    if (frf.json.contains(list))
      result["dropped"] = result["dropped"].get<std::size_t>() + frf.json[list].size();
  result["periods"] = stage.plan().experiments() * (stage.realizations - 1) * stage.periods;
  if (fitted)
    compare(read_model(directory / "model.json"), read_frf(directory / "frf.h5"), stage, plan,
            result);
}

}  // namespace

nlohmann::ordered_json judge_case(std::uint64_t seed, Trouble trouble,
                                  const std::filesystem::path& program,
                                  const std::filesystem::path& keep) {
  JudgementStage stage = draw_judgement_stage(seed);
  TroublePlan plan = draw_trouble(trouble, stage);
  Json result = {{"seed", seed},
                 {"trouble", to_string(trouble)},
                 {"variant", plan.variant},
                 {"stage", stage.description() + (stage.stage_file ? ", stage file" : "")}};
  Session session(program);
  std::optional<TemporaryDirectory> scratch;
  if (keep.empty()) scratch.emplace();
  const std::filesystem::path directory = scratch ? scratch->path() : keep;
  std::filesystem::create_directories(directory);
  for (int halvings = 0;; ++halvings) {
    try {
      run_steps(stage, plan, session, directory, result);
      break;
    } catch (const LoopRanAway&) {
      if (plan.cubic_n_m3 == 0.0 || halvings == kMostHalvings) throw;
      plan.cubic_n_m3 *= 0.5;
    }
  }
  result["seconds"] = session.seconds();
  return result;
}

bool is_garbage(const nlohmann::ordered_json& result) {
  if (result.value("exit", -1) != 0) return false;
  if (!(number(result, "excess") < 1.0)) return true;
  int intervals = 0;
  int hold = 0;
  for (const char* key : {"df", "dz"})
    if (result.contains(key))
      for (const Json& deviation : result[key]) {
        ++intervals;
        if (std::abs(deviation.get<double>()) < 1.96) ++hold;
      }
  return intervals >= 4 && 2 * hold < intervals;
}

}  // namespace stageid::test
