#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/hold_compensation.hpp"
#include "frf/statistics/order_statistic.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/fit/frf_quality.hpp"
#include "tools/steps/frf_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/json.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// The delay of the stage that a stageid log declares; 0 for other logs.
double declared_delay_s(const std::filesystem::path& log) {
  const auto json = parse_json<Json>(open_log(log)->info().metadata_json);
  return number_in(json, "transport_delay_s").value_or(0.0);
}

/// Over the outputs with a response; an output with a constant value has none.
double median_relative_std(const FrfEstimate& frf, const Eigen::MatrixXd& variance) {
  std::vector<double> ratio;
  for (Eigen::Index i = 0; i < variance.size(); ++i)
    if (const double power = std::norm(frf.response.data()[i]); power > 0.0)
      ratio.push_back(std::sqrt(variance.data()[i] / power));
  return ratio.empty() ? std::numeric_limits<double>::infinity() : order_statistic(ratio, 0.5);
}

Json frf_json(const FrfStep& step, const std::vector<std::string>& notes,
              const std::filesystem::path& output) {
  const FrfEstimate& frf = step.frf;
  Json json = {{"output", output.string()},
               {"inputs", frf.inputs.names},
               {"outputs", frf.outputs.names},
               {"lines", frf.lines()},
               {"first_hz", frf.frequency_hz[0]},
               {"last_hz", frf.frequency_hz[frf.lines() - 1]},
               {"realizations", frf.realizations},
               {"periods", frf.periods},
               {"bytes_read", step.bytes},
               {"seconds", step.seconds},
               {"notes", notes}};
  if (frf.noise_variance.size() > 0)
    json["median_relative_noise_std"] = median_relative_std(frf, frf.noise_variance);
  if (frf.total_variance.size() > 0)
    json["median_relative_total_std"] = median_relative_std(frf, frf.total_variance);
  json.update(quality_json(frf));
  return json;
}

/// stageid frf LOG... -o frf.h5
struct FrfFlags {
  std::vector<std::filesystem::path> logs;
  std::filesystem::path output;
  std::filesystem::path stage;
  bool no_health = false;
  FrfOptions options;
  std::vector<int> realizations;  ///< counted from 1, unlike those of `options`
  std::optional<double> delay_s;
  Compensation compensate = Compensation::none;
};

void estimate_response(const FrfFlags& flags, Console& console) {
  FrfOptions options = flags.options;
  for (const int realization : flags.realizations) {
    if (realization < 1)
      fail_request("--realizations: {} is out of range; realizations are counted from 1",
                   realization);
    options.realizations.push_back(realization - 1);
  }
  if (flags.delay_s && flags.compensate == Compensation::none)
    fail_request(
        "--delay: has no effect without --compensate; add --compensate delay or hold, or omit "
        "--delay");
  require_writable(flags.output, flags.logs);
  require_frf_ending(flags.output);
  options.team = console.team;
  FrfStep step = estimate_frf(flags.logs, options, {!flags.no_health, flags.stage}, console);
  std::vector<std::string> notes = dropped_lines(step.frf);
  if (flags.compensate != Compensation::none) {
    const double delay_s = flags.delay_s ? *flags.delay_s : declared_delay_s(flags.logs.front());
    if (!flags.delay_s)
      notes.push_back(fmt::format("--compensate: delay {} s, as declared in the log", delay_s));
    step.frf = compensate(step.frf, flags.compensate, delay_s);
  }
  if (console.team->rank() == 0) write_frf(flags.output, step.frf);
  const double rate = step.seconds > 0.0 ? step.bytes / step.seconds / 1e6 : 0.0;
  console.result("{}: {}", flags.output.string(), describe(step.frf));
  console.result("{:.1f} MB of samples in {:.2f} s, {:.0f} MB/s", step.bytes / 1e6, step.seconds,
                 rate);
  if (step.frf.noise_variance.size() > 0)
    console.result("median relative standard deviation from noise: {:.2e}",
                   median_relative_std(step.frf, step.frf.noise_variance));
  for (const std::string& line : linearity_lines(step.frf)) console.message(line);
  if (!flags.no_health)
    for (const std::string& line : health_lines(step.findings)) console.result(line);
  if (any_fault(step.findings)) console.exit_code = kNotTrustworthy;
  for (const std::string& note : notes) console.message("note: " + note);
  Json json = frf_json(step, notes, flags.output);
  if (!flags.no_health) json["health"] = health_json(step.findings);
  console.result(json);
}

}  // namespace

void frf_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(
      app, console, "frf", "Estimate the plant's FRF from closed-loop logs", estimate_response);
  add_required(command, "logs", flags.logs, "logs (.slog or .h5)");
  add_required(command, "-o,--output", flags.output, "HDF5 file to write");
  add_value(command, "--inputs", flags.options.inputs, "CHANNELS",
            "actuators A,B,...; default: the excited ones")
      ->delimiter(',');
  add_value(command, "--outputs", flags.options.outputs, "CHANNELS",
            "sensors C,D,...; default: all")
      ->delimiter(',');
  add_value(command, "--realizations", flags.realizations, "NUMBERS",
            "counted from 1; default: all complete ones")
      ->delimiter(',');
  add_value(
      command, "--transient-periods", flags.options.transient_periods, "COUNT",
      "periods to discard at the start of each run; default: as declared in the log, 0 for lpm");
  add_choice(command, "--method", flags.options.method,
             "periodic: means over periods | lpm: local polynomial method, which models the "
             "transient in whole records");
  add_choice(command, "--periods", flags.options.periods,
             "consistent: replace short glitches, discard periods with bumps or transients (lpm: "
             "discard periods with glitches) | unmarked: use all periods without marked samples");
  add_setting(command, "--smooth-covariance", flags.options.covariance_lines, "LINES",
              "odd number of neighbouring lines over which the noise covariance is averaged; "
              "more lines give it more degrees of freedom",
              kPositive);
  add_choice(command, "--covariance", flags.options.covariance,
             "diagonal: variances | full: also the covariances between channels");
  add_choice(command, "--compensate", flags.compensate,
             "remove from the response: none | delay | hold: hold and delay");
  add_value(command, "--delay", flags.delay_s, "SECONDS",
            "delay to remove with --compensate, in s, without the half sample of the "
            "hold; default: as declared in the log");
  command.add_option(
      "--stage", flags.stage,
      "stage or controller file for the health checks; default: the one stored in the log");
  command.add_flag("--no-health", flags.no_health, "skip the health checks of the data");
  add_threads(command, flags.options.threads);
}

}  // namespace stageid
