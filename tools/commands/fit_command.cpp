#include "tools/commands/commands.hpp"

#include <filesystem>
#include <string>
#include <vector>

#include "acquisition/files/fingerprint.hpp"
#include "estimation/problem/search_limit.hpp"
#include "frf/file/frf_file.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/exchange/model/covariance_file.hpp"
#include "tools/fit/fit_words.hpp"
#include "tools/steps/fit_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/steps/model_verdict.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

ExitCode fit_exit_code(const FitResult& result, bool whole) {
  if (result.status() == FitStatus::interrupted) return kInterrupted;
  return result.trustworthy() && whole ? kDone : kNotTrustworthy;
}

/// stageid fit FRF -o model.json
struct FitCommandFlags {
  std::filesystem::path frf;
  std::filesystem::path output;
  std::filesystem::path covariance;  ///< empty: not requested
  FitWords words;
  FitRequest request;  ///< only its numbers
  std::vector<double> band_hz;
};

FitRequest checked_request(const FitCommandFlags& flags) {
  FitRequest request = flags.request;
  parse_fit_words(flags.words, request);
  if (!flags.band_hz.empty()) request.band_hz = {flags.band_hz[0], flags.band_hz[1]};
  return request;
}

void require_covariance_file(const FitCommandFlags& flags) {
  if (flags.covariance.empty()) return;
  require_ending(flags.covariance, "a covariance", {".h5"});
  require_writable(flags.covariance, {flags.frf, flags.output});
}

/// A fit of free residues with one weight per number needs only the channels of its process. Ranks, weight matrices and
/// the covariance of all parameters connect all channels.
bool connects_channels(const FitCommandFlags& flags, const FitRequest& request) {
  return request.weighting == Weighting::user || request.weighting == Weighting::likelihood ||
         request.residue_rank > 0 || request.rigid_body.rank > 0 || !flags.covariance.empty();
}

void fit(const FitCommandFlags& flags, Console& console) {
  const FitRequest request = checked_request(flags);
  require_writable(flags.output, {flags.frf});
  require_model_ending(flags.output);
  require_covariance_file(flags);
  const Team* const readers = connects_channels(flags, request) ? nullptr : console.team;
  FitSetup setup = make_fit_setup(request, read_frf(flags.frf, readers));
  setup.options.team = console.team;
  setup.options.response_variance = false;  // that of the covariance is exact for all weights
  setup.options.covariance = !flags.covariance.empty();
  for (const std::string& doubt :
       health_notes(health_of(setup.frf.provenance_json), Severity::doubt))
    console.warning("{}: {}", flags.frf.string(), doubt);
  const FitStep step = fit_with_progress(setup, flags.frf.filename().string(),
                                         fingerprint_of_file(flags.frf), console);
  const FitResult& result = step.result;
  const bool writes = console.team->rank() == 0;
  if (writes) write_model(flags.output, result.model);
  const bool told = result.covariance.sandwich.size() > 0;
  if (told && writes) write_covariance(flags.covariance, result, setup.frf.frequency_hz);

  for (const std::string& line : result.decisions) console.result(line);
  console.result(cost_line(result.cost));
  for (const std::string& line : mode_table(result.model)) console.result(line);
  for (const std::string& line : delay_lines(result.model)) console.result(line);
  console.result("{}: {}, {} ({})", flags.output.string(), relative_error_text(result.model.fit),
                 to_string(result.status()), result.message());
  const bool whole = told || flags.covariance.empty();
  console.exit_code = fit_exit_code(result, whole);
  ResultFiles files;
  files.frf = flags.frf;
  files.model = flags.output;
  const ModelVerdict verdict = judge_model(result.model, {}, {}, {}, files);
  Json json = {{"output", flags.output.string()},
               {"status", to_string(result.status())},
               {"message", result.message()},
               {"relative_rms_error", result.model.fit.relative_rms_error},
               {"cost", result.cost},
               {"decisions", result.decisions},
               {"findings", result.findings},
               {"modes", modes_json(result.model)},
               {"delays", delays_json(result.model)},
               {"seconds", step.seconds}};
  json.update(verdict_json(verdict));
  console.result(json);
  if (!explain_the_rest(verdict.problems)) {
    for (const std::string& warning : setup.warnings)
      console.warning("{}: {}", flags.frf.string(), warning);
    for (const std::string& finding : findings_beside_message(result))
      console.warning("{}: {}", flags.output.string(), finding);
  }
  if (!whole)
    console.warning("{}: not written: {}", flags.covariance.string(),
                    result.decisions.empty() ? "" : result.decisions.back());
  if (!verdict.trustworthy) warn_of(verdict.problems, flags.output, console);
}

}  // namespace

void fit_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(app, console, "fit", "Fit a modal model to an FRF", fit);
  add_required(command, "frf", flags.frf, "frf.h5");
  add_required(command, "-o,--output", flags.output, "model.json to write");
  command.add_option("--covariance", flags.covariance,
                     "FILE.h5 to write: covariance of all parameters, and variance and 95 % "
                     "radius of the model response");
  add_band(command, flags.band_hz, "all lines");
  command.add_option("--modes", flags.words.modes,
                     "auto | none | COUNT | frequencies f1,f2,... in Hz, each with a damping ratio "
                     "if you like (f1:0.01) | modes.json; default: auto, or none with --submodel");
  command.add_option(
      "--weighting", flags.words.weighting,
      "unit | inverse_magnitude | relative | noise_variance | total_variance | likelihood | "
      "FILE.h5 with /weights or /weight_matrices; default: from the variances in the FRF");
  command.add_option("--hold", flags.words.hold,
                     "none | phase: half a sample of delay | sinc: phase and magnitude | exact: "
                     "hold, delay and sampler, including aliasing. Default: from the FRF");
  command.add_option(
      "--delay", flags.words.delay,
      "SECONDS | estimate | per_channel; default: for a compensated FRF, the delay that was "
      "removed; for one without a hold, none; else estimate (per_channel if the data require it)");
  command.add_option(
      "--rigid-body", flags.words.rigid_body,
      "none | full | RANK: the term B_0 / s^2 of this rank | suspension: modes below the lowest "
      "line, for a body on soft springs | suspension:F1:F2: the same at known frequencies in Hz | "
      "auto: chosen from the data. Default: auto, or none with --submodel or if the outputs are "
      "accelerations");
  command.add_option("--direct-term", flags.words.direct_term,
                     "none | full: a constant, the compliance of modes above the band. Default: "
                     "chosen from the data; full if the outputs are accelerations");
  add_setting(command, "--residue-rank", flags.words.residue_rank, "TEXT",
              "full | 1: each residue is phi psi^T with one pair of mode shapes, as for a "
              "mechanical mode");
  add_value(command, "--submodel", flags.words.submodels, "TERM",
            "add the term (B_0 + ... + B_m s^m) / (s^l A) with a polynomial A of order n, "
            "e.g. n=4,m=3,f=120:180,zeta=0.01; repeatable. l: number of integrators, default "
            "0. m: default n + l - 1. f: starting frequencies in Hz, one per pole pair, and "
            "last that of the real pole if n is odd; default: found by a search. zeta: "
            "starting damping ratio. n=auto: one denominator for all modes found by a search")
      ->allow_extra_args(false);
  command.add_option("--damping", flags.words.damping,
                     "proportional: numerators B_0 | general: B_0 + B_1 s. Default: chosen from "
                     "the data; general if the outputs are accelerations");
  add_setting(command, "--method", flags.words.method, "TEXT",
              "riv: refined instrumental variables | gn: Gauss-Newton | sk: Sanathanan-Koerner");
  add_setting(command, "--max-iterations", flags.request.max_iterations, "COUNT",
              "iterations per fit");
  add_setting(command, "--search-seconds", flags.request.search_seconds, "SECONDS",
              "limit of the search, in seconds of work on a typical core, so that the result "
              "does not depend on the machine. At the limit, the best model so far is written "
              "and the exit code is 3. 0: unlimited",
              kNotNegative);
  add_threads(command, flags.request.threads);
}

}  // namespace stageid
