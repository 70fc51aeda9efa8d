#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/files/fingerprint.hpp"
#include "estimation/problem/search_limit.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/fit/fit_flags.hpp"
#include "tools/steps/covariance_file.hpp"
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
  std::uint64_t seed_ = 0;
};

FitCommand::FitCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(app, "fit", "Fit the additive model to an FRF");
  command->add_option("frf", frf_, "frf.h5")->required();
  command->add_option("-o,--output", output_, "model.json to write")->required();
  command->add_option(
      "--covariance", covariance_,
      "FILE.h5 to write: covariance of all parameters (sandwich and maximum likelihood) with names "
      "and units, and the model response with its variance and 95 % radius");
  command->add_option("--band", band_hz_, "LOW HIGH, Hz; default: all lines")->expected(2);
  command->add_option("--modes", flags_.modes,
                      "auto | none | COUNT | frequencies f1,f2,... in Hz | modes.json; default: "
                      "auto, or none with --submodel");
  command->add_option(
      "--weighting", flags_.weighting,
      "unit | inverse_magnitude | relative | noise_variance | total_variance | likelihood | "
      "FILE.h5 with /weights or /weight_matrices; default: from the variances in the FRF");
  command->add_option("--hold", flags_.hold, "none | phase | sinc | exact; default: from the FRF");
  command->add_option(
      "--delay", flags_.delay,
      "SECONDS | estimate | per_channel; default: from the FRF, per_channel if the data "
      "require it");
  command->add_option(
      "--rigid-body", flags_.rigid_body,
      "none | full | RANK: the term B_0 / s^2 | suspension: a mode below the lines instead, for a "
      "rigid body on weak springs | suspension:F1:F2: at these known frequencies, Hz | auto: none, "
      "full or suspension, as the data require; default: auto, or none with --submodel or if the "
      "outputs are accelerations");
  command->add_option(
      "--direct-term", flags_.direct_term,
      "none | full: a constant, the compliance of modes above the band; default: as "
      "the data require, full if the outputs are accelerations");
  command
      ->add_option("--residue-rank", flags_.residue_rank,
                   "full | 1: residues phi psi^T of mechanical modes")
      ->capture_default_str();
  command
      ->add_option(
          "--submodel", flags_.submodels,
          "(B_0 + ... + B_m s^m) / (s^l A), A of order n: l=0,n=4,m=3,f=120:180,zeta=0.01; "
          "repeatable. Default of m: n + l - 1. f: starting frequencies of the poles in Hz, one "
          "per pair, the real pole of an odd n last; default: a search. n=auto: one denominator "
          "for all modes that a search finds")
      ->allow_extra_args(false);
  command->add_option(
      "--damping", flags_.damping,
      "proportional | general: numerators B_0, or B_0 + B_1 s; default: as the data "
      "require, general if the outputs are accelerations");
  command->add_option("--method", flags_.method, "riv | gn | sk")->capture_default_str();
  command->add_option("--max-iterations", request_.max_iterations, "iterations per fit")
      ->capture_default_str();
  command
      ->add_option("--search-seconds", request_.search_seconds,
                   "budget of the mode search, in seconds of a typical core; counted in work, so "
                   "the result does not depend on the machine. When it is used up, the best model "
                   "so far is written and the exit code is 3. 0: unlimited")
      ->check(kNotNegative)
      ->capture_default_str();
  command->add_option("--seed", seed_, "ignored: the fit is deterministic");
  command
      ->add_option("--threads", request_.threads, "0: all cores; the result does not depend on it")
      ->check(kNotNegative)
      ->capture_default_str();
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
