#include "tools/commands/commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "acquisition/files/json_members.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "frf/file/frf_file.hpp"
#include "frf/response/hold_compensation.hpp"
#include "frf/statistics/order_statistic.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/fit/frf_quality.hpp"
#include "tools/steps/fft_wisdom_file.hpp"
#include "tools/steps/frf_step.hpp"
#include "tools/steps/health_step.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/output_paths.hpp"

namespace stageid {
namespace {

/// The delay of the stage that a stageid log declares; 0 for other logs.
double declared_delay_s(const std::filesystem::path& log) {
  const auto json = parse_json<nlohmann::json>(open_log(log)->info().metadata_json);
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

nlohmann::ordered_json frf_json(const FrfEstimate& frf, const FrfStep& step,
                                const std::vector<std::string>& notes,
                                const std::filesystem::path& output) {
  nlohmann::ordered_json json = {{"output", output.string()},
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
  json["nonlinearity"] = linearity_json(frf);
  json["dropped_periods"] = dropped_json(frf);
  json["left_out_realizations"] = left_out_json(frf);
  return json;
}

/// stageid frf LOG... -o frf.h5
class FrfCommand {
 public:
  FrfCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  FrfStep estimate(const FrfOptions& options) const;

  Console& console_;
  std::vector<std::filesystem::path> logs_;
  std::filesystem::path output_;
  std::filesystem::path stage_;
  std::filesystem::path fft_wisdom_;
  bool no_health_ = false;
  std::vector<std::string> inputs_;
  std::vector<std::string> outputs_;
  std::vector<int> realizations_;
  std::optional<int> transient_periods_;
  std::optional<double> delay_s_;
  FrfMethod method_ = FrfMethod::periodic;
  PeriodChoice periods_ = PeriodChoice::consistent;
  int covariance_lines_ = 1;
  CovarianceKind covariance_ = CovarianceKind::diagonal;
  Compensation compensate_ = Compensation::none;
  int threads_ = 0;
};

FrfCommand::FrfCommand(CLI::App& app, Console& console) : console_(console) {
  CLI::App* command = add_command(app, "frf", "Estimate the plant's FRF from closed-loop logs");
  command->add_option("logs", logs_, "logs (.slog or .h5)")->required();
  command->add_option("-o,--output", output_, "HDF5 file to write")->required();
  command->add_option("--inputs", inputs_, "actuators A,B,...; default: the excited ones")
      ->delimiter(',');
  command->add_option("--outputs", outputs_, "sensors C,D,...; default: all")->delimiter(',');
  command->add_option("--realizations", realizations_, "counted from 1; default: all complete ones")
      ->delimiter(',');
  command->add_option(
      "--transient-periods", transient_periods_,
      "periods to discard at the start of each run; default: as declared in the log, 0 for lpm");
  add_choice(*command, "--method", method_,
             "periodic: means over periods | lpm: whole records, transient modelled");
  add_choice(*command, "--periods", periods_,
             "consistent: discard periods with glitches, bumps or transients (lpm: only "
             "glitches) | unmarked: use all periods without marked samples");
  command
      ->add_option("--smooth-covariance", covariance_lines_,
                   "odd number of neighbouring lines over which the noise covariance is averaged; "
                   "more lines give it more degrees of freedom")
      ->type_name("LINES")
      ->check(kPositive)
      ->capture_default_str();
  add_choice(*command, "--covariance", covariance_,
             "diagonal: variances | full: also the covariances between channels");
  add_choice(*command, "--compensate", compensate_,
             "remove from the response: none | delay | hold: hold and delay");
  command->add_option("--delay", delay_s_,
                      "delay to remove with --compensate, in s, without the half sample of the "
                      "hold; default: as declared in the log");
  command->add_option(
      "--stage", stage_,
      "stage or controller file for the health checks; default: the one stored in the log");
  command->add_flag("--no-health", no_health_, "skip the health checks of the data");
  command
      ->add_option("--fft-wisdom", fft_wisdom_,
                   "store FFT plans found by timing in FILE and reuse those already there")
      ->type_name("FILE");
  add_threads(*command, threads_);
  command->final_callback([this] { run(); });
}

FrfStep FrfCommand::estimate(const FrfOptions& options) const {
  const HealthRequest health{!no_health_, stage_};
  if (fft_wisdom_.empty()) return estimate_frf(logs_, options, health, console_);
  FftWisdomFile wisdom(fft_wisdom_);
  FrfStep step = estimate_frf(logs_, options, health, console_);
  note_fft_plans(step.frf, wisdom.save());
  return step;
}

void FrfCommand::run() const {
  FrfOptions options;
  options.inputs = inputs_;
  options.outputs = outputs_;
  options.transient_periods = transient_periods_;
  options.method = method_;
  options.covariance = covariance_;
  options.periods = periods_;
  options.covariance_lines = covariance_lines_;
  options.threads = threads_;
  for (const int realization : realizations_) {
    if (realization < 1)
      throw std::invalid_argument(fmt::format(
          "--realizations: {} is out of range; realizations are counted from 1", realization));
    options.realizations.push_back(realization - 1);
  }
  if (delay_s_ && compensate_ == Compensation::none)
    throw std::invalid_argument(
        "--delay: has no effect without --compensate; add --compensate delay or hold, or omit "
        "--delay");
  require_writable(output_, logs_);
  require_frf_ending(output_);
  FrfStep step = estimate(options);
  std::vector<std::string> notes = dropped_lines(step.frf);
  if (compensate_ != Compensation::none) {
    const double delay_s = delay_s_ ? *delay_s_ : declared_delay_s(logs_.front());
    if (!delay_s_)
      notes.push_back(fmt::format("--compensate: delay {} s, as declared in the log", delay_s));
    step.frf = compensate(step.frf, compensate_, delay_s);
  }
  write_frf(output_, step.frf);
  const double rate = step.seconds > 0.0 ? step.bytes / step.seconds / 1e6 : 0.0;
  console_.result(fmt::format("{}: {}", output_.string(), describe(step.frf)));
  console_.result(fmt::format("{:.1f} MB of samples in {:.2f} s, {:.0f} MB/s", step.bytes / 1e6,
                              step.seconds, rate));
  if (step.frf.noise_variance.size() > 0)
    console_.result(fmt::format("median relative standard deviation from noise: {:.2e}",
                                median_relative_std(step.frf, step.frf.noise_variance)));
  for (const std::string& line : linearity_lines(step.frf)) console_.message(line);
  if (!no_health_)
    for (const std::string& line : health_lines(step.findings)) console_.result(line);
  if (any_fault(step.findings)) console_.exit_code = kNotTrustworthy;
  for (const std::string& note : notes) console_.message("note: " + note);
  nlohmann::ordered_json json = frf_json(step.frf, step, notes, output_);
  if (!no_health_) json["health"] = health_json(step.findings);
  console_.result(json);
}

}  // namespace

std::shared_ptr<void> frf_command(CLI::App& app, Console& console) {
  return std::make_shared<FrfCommand>(app, console);
}

}  // namespace stageid
