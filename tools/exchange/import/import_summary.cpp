#include "tools/exchange/import/import_summary.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "acquisition/files/counted.hpp"

namespace stageid {
namespace {

/// "400", "8 to 12".
std::string range_text(const std::vector<std::uint64_t>& values) {
  const auto [low, high] = std::ranges::minmax_element(values);
  return *low == *high ? fmt::format("{}", *low) : fmt::format("{} to {}", *low, *high);
}

/// Dimensionless channels have the unit in their name: "y1 [m], y2 [rad]".
std::string named(const ChannelList& channels) {
  std::vector<std::string> parts;
  for (std::size_t c = 0; c < channels.size(); ++c)
    parts.push_back(fmt::format("{} [{}]", channels.names[c], channels.units[c]));
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace

void LogSummary::add(const LogRun& run, const Eigen::Ref<const Eigen::MatrixXd>& period,
                     const Eigen::Ref<const Eigen::MatrixXd>& actuators,
                     const Eigen::Ref<const Eigen::MatrixXd>& sensors) {
  runs_.push_back(run);
  const auto add_squares = [](const auto& columns, Eigen::VectorXd& sums) {
    if (sums.size() == 0) sums.setZero(columns.cols());
    sums += columns.colwise().squaredNorm().transpose();
  };
  add_squares(period, excitation_);
  add_squares(actuators, actuators_);
  add_squares(sensors, sensors_);
  std::set<Eigen::Index>& excited = excited_[run.experiment];
  for (Eigen::Index c = 0; c < period.cols(); ++c)
    if (!period.col(c).isZero(0.0)) excited.insert(c);
}

ImportSummary LogSummary::summary(const LogInfo& info,
                                  const std::vector<std::string>& notes) const {
  std::set<int> realizations;
  std::vector<std::uint64_t> periods;
  double duration_s = 0.0;
  std::uint64_t samples = 0;
  for (const LogRun& run : runs_) {
    realizations.insert(run.realization);
    periods.push_back(run.samples / static_cast<std::uint64_t>(info.period_samples));
    duration_s += static_cast<double>(run.samples) / info.sample_rate_hz;
    samples += run.samples;
  }
  ImportSummary out;
  out.lines = notes;
  out.lines.push_back(
      fmt::format("{}: {} of {}, {} periods each ({} transient), {} samples per period",
                  counted(runs_.size(), "run"), counted(realizations.size(), "realization"),
                  counted(excited_.size(), "experiment"), range_text(periods),
                  info.transient_periods, info.period_samples));
  out.lines.push_back(
      fmt::format("sample rate {} Hz, total duration {:.6g} s", info.sample_rate_hz, duration_s));
  Json excited = Json::array();
  for (const auto& [experiment, channels] : excited_) {
    std::vector<std::string> names;
    for (const Eigen::Index c : channels) names.push_back(info.excitation.name(c));
    out.lines.push_back(fmt::format("experiment {} excites {}", experiment + 1,
                                    names.empty() ? std::string("nothing: the excitation is zero")
                                                  : fmt::format("{}", fmt::join(names, ", "))));
    excited.push_back({{"experiment", experiment + 1}, {"excites", names}});
  }
  out.json = {{"kind", "log"},
              {"runs", runs_.size()},
              {"realizations", realizations.size()},
              {"experiments", excited_.size()},
              {"periods", *std::ranges::min_element(periods)},
              {"transient_periods", info.transient_periods},
              {"period_samples", info.period_samples},
              {"sample_rate_hz", info.sample_rate_hz},
              {"duration_s", duration_s},
              {"excited", excited}};
  const auto add_rms = [&out](const char* group, const ChannelList& channels,
                              const Eigen::VectorXd& squares, std::size_t rows) {
    const Eigen::VectorXd rms = (squares / static_cast<double>(rows)).cwiseSqrt();
    std::vector<std::string> parts;
    Json& list = out.json[group] = Json::array();
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const double value = rms[c];
      parts.push_back(fmt::format("{} {:.4g} {}", channels.names[c], value, channels.units[c]));
      list.push_back({{"name", channels.names[c]}, {"unit", channels.units[c]}, {"rms", value}});
    }
    out.lines.push_back(fmt::format("rms of {}: {}", group, fmt::join(parts, ", ")));
  };
  const auto period_samples = static_cast<std::size_t>(info.period_samples);
  add_rms("excitation", info.excitation, excitation_, runs_.size() * period_samples);
  add_rms("actuators", info.actuators, actuators_, samples);
  add_rms("sensors", info.sensors, sensors_, samples);
  out.json["notes"] = notes;
  return out;
}

ImportSummary summary_of(const FrfEstimate& frf, const std::vector<std::string>& notes) {
  ImportSummary out;
  out.lines = notes;
  const double first = frf.lines() > 0 ? frf.frequency_hz[0] : 0.0;
  const double last = frf.lines() > 0 ? frf.frequency_hz[frf.lines() - 1] : 0.0;
  out.lines.push_back(fmt::format(
      "{}, {:.6g} to {:.6g} Hz; sample rate {}, hold {}", counted(frf.lines(), "line"), first, last,
      frf.sample_rate_hz > 0.0 ? fmt::format("{} Hz", frf.sample_rate_hz) : std::string("unknown"),
      to_string(frf.hold)));
  out.lines.push_back(fmt::format("outputs {}; inputs {}", named(frf.outputs), named(frf.inputs)));
  const bool noise = frf.noise_variance.size() > 0;
  const bool total = frf.total_variance.size() > 0;
  out.lines.push_back(noise && total ? "noise variance and total variance"
                      : noise        ? "noise variance, no total variance"
                      : total        ? "total variance, no noise variance"
                                     : "no variances: 'fit' weights by the magnitude");
  const Eigen::VectorXd rms = frf.response.cwiseAbs2().rowwise().mean().cwiseSqrt();
  Json channels = Json::array();
  for (Eigen::Index c = 0; c < frf.response.rows(); ++c)
    channels.push_back({{"output", frf.outputs.name(c % frf.n_outputs())},
                        {"input", frf.inputs.name(c / frf.n_outputs())},
                        {"rms", rms[c]}});
  out.json = {{"kind", "frf"},
              {"lines", frf.lines()},
              {"band_hz", {first, last}},
              {"sample_rate_hz", frf.sample_rate_hz},
              {"hold", to_string(frf.hold)},
              {"outputs", frf.outputs.names},
              {"output_units", frf.outputs.units},
              {"inputs", frf.inputs.names},
              {"input_units", frf.inputs.units},
              {"noise_variance", noise},
              {"total_variance", total},
              {"channels", channels},
              {"notes", notes}};
  return out;
}

}  // namespace stageid
