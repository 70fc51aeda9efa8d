#include "tools/exchange/matlab/mat_log.hpp"

#include <string>
#include <utility>
#include <vector>

#include "acquisition/slog/slog_index.hpp"

namespace stageid {
namespace {

NamedArray number(std::string name, double value) {
  return {std::move(name), {}, std::vector{value}};
}

NamedArray text(std::string name, const std::string& value) {
  return {std::move(name), {}, std::vector{value}};
}

NamedArray matrix(std::string name, const Eigen::MatrixXd& values) {
  NamedArray out{std::move(name),
                 {static_cast<std::size_t>(values.rows()), static_cast<std::size_t>(values.cols())},
                 {}};
  const auto rows = values.reshaped<Eigen::RowMajor>();
  out.values = std::vector<double>(rows.begin(), rows.end());
  return out;
}

ArrayList head(const LogInfo& info, const std::filesystem::path& to) {
  ArrayList out{to, {}};
  out.arrays = {text("@format", "stageid-log"),
                number("@format_version", 1),
                number("@sample_rate_hz", info.sample_rate_hz),
                number("@period_samples", info.period_samples),
                number("@transient_periods", info.transient_periods),
                text("@metadata_json", info.metadata_json)};
  for (const auto& [name, channels] :
       {std::pair{"excitation", &info.excitation}, std::pair{"actuators", &info.actuators},
        std::pair{"sensors", &info.sensors}}) {
    const std::string path = std::string("channels/") + name;
    out.arrays.push_back({path, {channels->names.size()}, channels->names});
    out.arrays.push_back({path + "@unit", {channels->units.size()}, channels->units});
  }
  return out;
}

ArrayList run_arrays(const LogReader& log, std::size_t run, const std::filesystem::path& to) {
  const LogRun& record = log.runs()[run];
  LogSamples samples;
  log.read(run, 0, record.samples, samples);
  const std::string path = "run" + slog_run_name(run) + "/";
  ArrayList out{to, {}};
  out.arrays = {number(path + "realization", record.realization),
                number(path + "experiment", record.experiment),
                number(path + "complete", record.complete ? 1.0 : 0.0),
                text(path + "started_utc", record.started_utc),
                matrix(path + "excitation", log.excitation(run)),
                matrix(path + "actuators", samples.actuators),
                matrix(path + "sensors", samples.sensors),
                matrix(path + "marked", samples.marked.cast<double>().matrix())};
  return out;
}

}  // namespace

void write_mat_log(const LogReader& log, const std::filesystem::path& to, MatVersion version,
                   const ConvertOptions& options) {
  ConvertProgress progress(log, options);
  MatWriter writer(to, version);
  writer.add(head(log.info(), to));
  for (std::size_t run = 0; run < log.runs().size(); ++run) {
    if (!progress.wanted(log.runs()[run])) continue;
    writer.add(run_arrays(log, run, to));
    progress.add(log.runs()[run].samples);
  }
  writer.close();
}

}  // namespace stageid
