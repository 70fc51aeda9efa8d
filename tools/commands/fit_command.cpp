#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/files/fingerprint.hpp"
#include "estimation/problem/search_limit.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/model/covariance_file.hpp"
#include "tools/fit/fit_flags.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

ExitCode fit_exit_code(const FitResult& result, bool whole) {
  if (result.status == FitStatus::interrupted) return kInterrupted;
  return result.trustworthy() && whole ? kDone : kNotTrustworthy;
}

/// stageid fit FRF -o model.json
class FitCommand {
 public:
  FitCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  FitRequest checked_request() const;
  void require_covariance_file() const;

  Console& console_;
  std::filesystem::path frf_;
  std::filesystem::path output_;
  std::filesystem::path covariance_;  ///< empty: not requested
  FitFlags flags_;
  FitRequest request_;  ///< only its numbers
  std::vector<double> band_hz_;
};

FitCommand::FitCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(app, "fit", "Fit the additive model to an FRF");
  command->add_option("frf", frf_, "frf.h5")->required();
  command->add_option("-o,--output", output_, "model.json to write")->required();
  command->add_option("--covariance", covariance_,
                      "FILE.h5 to write: covariance of all parameters, and variance and 95 % "
                      "radius of the model response");
  command->add_option("--band", band_hz_, "LOW HIGH, Hz; default: all lines")->expected(2);
  command->add_option("--modes", flags_.modes,
                      "auto | none | COUNT | frequencies f1,f2,... in Hz | modes.json; default: "
                      "auto, or none with --submodel");
  command->add_option(
      "--weighting", flags_.weighting,
      "unit | inverse_magnitude | relative | noise_variance | total_variance | likelihood | "
      "FILE.h5 with /weights or /weight_matrices; default: from the variances in the FRF");
  command->add_option("--hold", flags_.hold,
                      "none | phase: half a sample of delay | sinc: phase and magnitude | exact: "
                      "hold, delay and sampler, including aliasing. Default: from the FRF");
  command->add_option(
      "--delay", flags_.delay,
      "SECONDS | estimate | per_channel. Default: estimate (per_channel if the data "
      "require it); the known delay of a compensated FRF; none without a hold");
  command->add_option("--rigid-body", flags_.rigid_body,
                      "none | full | RANK: the term B_0 / s^2 of this rank | suspension: modes "
                      "below the lines, for a body on soft springs | suspension:F1:F2: the same at "
                      "known frequencies in Hz | auto: chosen from the data. Default: auto, or "
                      "none with --submodel or if the outputs are accelerations");
  command->add_option("--direct-term", flags_.direct_term,
                      "none | full: a constant, the compliance of modes above the band. Default: "
                      "chosen from the data; full if the outputs are accelerations");
  command
      ->add_option("--residue-rank", flags_.residue_rank,
                   "full | 1: residues phi psi^T of mechanical modes")
      ->capture_default_str();
  command
      ->add_option("--submodel", flags_.submodels,
                   "adds the term (B_0 + ... + B_m s^m) / (s^l A) with A of order n, such as "
                   "n=4,m=3,f=120:180,zeta=0.01; repeatable. m: n + l - 1 if omitted. f: starting "
                   "frequencies in Hz, one per pole pair, then the real pole of an odd n; found by "
                   "a search if omitted. n=auto: one denominator for all modes that a search finds")
      ->allow_extra_args(false);
  command->add_option("--damping", flags_.damping,
                      "proportional: numerators B_0 | general: B_0 + B_1 s. Default: chosen from "
                      "the data; general if the outputs are accelerations");
  command
      ->add_option(
          "--method", flags_.method,
          "riv: refined instrumental variables | gn: Gauss-Newton | sk: Sanathanan-Koerner")
      ->capture_default_str();
  command->add_option("--max-iterations", request_.max_iterations, "iterations per fit")
      ->capture_default_str();
  command
      ->add_option("--search-seconds", request_.search_seconds,
                   "budget of the mode search in seconds of a typical core, counted as work so "
                   "that the result does not depend on the machine. If it is used up, the best "
                   "model so far is written and the exit code is 3. 0: unlimited")
      ->check(kNotNegative)
      ->capture_default_str();
  add_threads(*command, request_.threads);
  command->final_callback([this] { run(); });
}

FitRequest FitCommand::checked_request() const {
  FitRequest request = request_;
  parse_fit_flags(flags_, request);
  if (!band_hz_.empty()) request.band_hz = {band_hz_[0], band_hz_[1]};
  return request;
}

void FitCommand::require_covariance_file() const {
  if (covariance_.empty()) return;
  require_ending(covariance_, "a covariance", {".h5"});
  require_writable(covariance_, {frf_, output_});
}

void FitCommand::run() const {
  const FitRequest request = checked_request();
  require_writable(output_, {frf_});
  require_model_ending(output_);
  require_covariance_file();
  FitSetup setup = make_fit_setup(request, read_frf(frf_));
  setup.options.response_variance = false;  // that of the covariance is exact for all weights
  setup.options.covariance = !covariance_.empty();
  for (const std::string& doubt :
       health_notes(health_of(setup.frf.provenance_json), Severity::doubt))
    console_.warning(fmt::format("{}: {}", frf_.string(), doubt));
  for (const std::string& warning : setup.warnings)
    console_.warning(fmt::format("{}: {}", frf_.string(), warning));
  const FitStep step =
      fit_with_progress(setup, frf_.filename().string(), fingerprint_of_file(frf_), console_);
  const FitResult& result = step.result;
  write_model(output_, result.model);
  const bool told = result.covariance.sandwich.size() > 0;
  if (told) write_covariance(covariance_, result, setup.frf.frequency_hz);

  for (const std::string& line : result.decisions) console_.result(line);
  console_.result(cost_line(result.cost));
  for (const std::string& line : mode_table(result.model)) console_.result(line);
  for (const std::string& line : delay_lines(result.model)) console_.result(line);
  console_.result(fmt::format("{}: {}, {} ({})", output_.string(),
                              relative_error_text(result.model.fit), to_string(result.status),
                              result.message));
  const bool whole = told || covariance_.empty();
  console_.exit_code = fit_exit_code(result, whole);
  console_.result({{"output", output_.string()},
                   {"status", to_string(result.status)},
                   {"message", result.message},
                   {"trustworthy", result.trustworthy()},
                   {"relative_rms_error", result.model.fit.relative_rms_error},
                   {"cost", result.cost},
                   {"decisions", result.decisions},
                   {"findings", result.findings},
                   {"modes", modes_json(result.model)},
                   {"delays", delays_json(result.model)},
                   {"seconds", step.seconds}});
  for (const std::string& finding : result.findings)
    if (result.trustworthy() || result.message.find(finding) == std::string::npos)
      console_.warning(fmt::format("{}: {}", output_.string(), finding));
  if (!whole)
    console_.warning(fmt::format("{}: not written: {}", covariance_.string(),
                                 result.decisions.empty() ? "" : result.decisions.back()));
  if (!result.trustworthy())
    console_.warning(fmt::format(
        "{}: not to be trusted: {}. The model was written; do not use it until this is resolved.",
        output_.string(), result.message));
}

}  // namespace

std::shared_ptr<void> fit_command(CLI::App& app, Console& console) {
  return std::make_shared<FitCommand>(app, console);
}

}  // namespace stageid
