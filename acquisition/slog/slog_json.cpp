#include "acquisition/slog/slog_json.hpp"

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_text.hpp"

namespace stageid {

namespace {

using Json = nlohmann::
    ordered_json;  // keeps the order of keys, so that metadata are written as they were read

std::string text_of(const Json& json) {
  try {
    return json.dump();
  } catch (const Json::exception&) {
    throw std::invalid_argument("log: a name, unit or message is not valid UTF-8");
  }
}

/// Parses, and converts errors of the library into one-line messages.
template <typename Read>
auto parse(std::string_view text, const char* what, Read read) {
  try {
    return read(parse_json<Json>(text));
  } catch (const Json::exception&) {  // discarded, too
    fail_request("the {} is invalid", what);
  }
}

Json json_of(const ChannelList& channels) {
  return {{"names", channels.names}, {"units", channels.units}};
}

ChannelList channels_of(const Json& json) {
  return {json.at("names").get<std::vector<std::string>>(),
          json.at("units").get<std::vector<std::string>>()};
}

/// [[from_ns, to_ns, count], ...] of the nonempty bins.
Json json_of(const TimingHistogram& histogram) {
  Json bins = Json::array();
  for (std::size_t bin = 0; bin < TimingHistogram::kBins; ++bin)
    if (histogram.count(bin) > 0)
      bins.push_back(
          {TimingHistogram::lower_ns(bin), TimingHistogram::upper_ns(bin), histogram.count(bin)});
  return bins;
}

TimingHistogram histogram_of(const Json& json) {
  TimingHistogram histogram;
  for (const Json& bin : json) {
    const auto lower = bin.at(0).get<std::uint64_t>();
    if (lower > 0xFFFF'FFFF || TimingHistogram::lower_ns(TimingHistogram::bin_of(
                                   static_cast<std::uint32_t>(lower))) != lower)
      fail_request("end of a run: invalid bin edge of a timing histogram: {} ns", lower);
    histogram.add_bin(TimingHistogram::bin_of(static_cast<std::uint32_t>(lower)),
                      bin.at(2).get<std::uint64_t>());
  }
  return histogram;
}

Json json_of(const RunTiming& timing) {
  return {{"execution", json_of(timing.execution)},
          {"lateness", json_of(timing.lateness)},
          {"skipped", timing.skipped}};
}

RunTiming timing_of(const Json& json) {
  return {histogram_of(json.at("execution")), histogram_of(json.at("lateness")),
          json.at("skipped").get<std::uint64_t>()};
}

}  // namespace

std::string to_json(const LogInfo& info) {
  Json metadata = parse_json<Json>(info.metadata_json);
  if (metadata.is_discarded()) throw std::invalid_argument("log: metadata_json is not valid JSON");
  Json json = {
      {"sample_rate_hz", info.sample_rate_hz},       {"period_samples", info.period_samples},
      {"transient_periods", info.transient_periods}, {"excitation", json_of(info.excitation)},
      {"actuators", json_of(info.actuators)},        {"sensors", json_of(info.sensors)}};
  if (info.stamps) json["stamps"] = true;
  json["metadata"] = std::move(metadata);
  return text_of(json);
}

LogInfo parse_log_info(std::string_view text) {
  LogInfo info = parse(text, "log description", [](const Json& json) {
    LogInfo read;
    read.sample_rate_hz = json.at("sample_rate_hz").get<double>();
    read.period_samples = json.at("period_samples").get<int>();
    read.transient_periods = json.at("transient_periods").get<int>();
    read.excitation = channels_of(json.at("excitation"));
    read.actuators = channels_of(json.at("actuators"));
    read.sensors = channels_of(json.at("sensors"));
    read.stamps = json.value("stamps", false);
    read.metadata_json = json.at("metadata").dump();
    return read;
  });
  check_log_info(info);
  return info;
}

std::string run_begin_json(const SlogRunBegin& begin) {
  return text_of({{"realization", begin.realization},
                  {"experiment", begin.experiment},
                  {"started_utc", begin.started_utc},
                  {"excitation_columns", begin.excitation_columns}});
}

SlogRunBegin parse_run_begin(std::string_view text) {
  return parse(text, "start of a run", [](const Json& json) {
    SlogRunBegin begin;
    begin.realization = json.at("realization").get<int>();
    begin.experiment = json.at("experiment").get<int>();
    begin.started_utc = json.at("started_utc").get<std::string>();
    begin.excitation_columns = json.at("excitation_columns").get<std::vector<int>>();
    return begin;
  });
}

std::string run_end_json(const LogRun& run) {
  const RunHealth& health = run.health;
  Json json = {{"realization", run.realization},
               {"experiment", run.experiment},
               {"samples", run.samples},
               {"complete", run.complete},
               {"health",
                {{"cycles", health.cycles},
                 {"late", health.late},
                 {"missing", health.missing},
                 {"marked", health.marked},
                 {"largest_lateness_ns", health.largest_lateness_ns},
                 {"seconds", health.seconds}}}};
  if (health.irregular > 0) json["health"]["irregular"] = health.irregular;
  if (health.lost > 0) json["health"]["lost"] = health.lost;
  if (!run.timing.empty()) json["timing"] = json_of(run.timing);
  return text_of(json);
}

LogRun parse_run_end(std::string_view text) {
  return parse(text, "end of a run", [](const Json& json) {
    const Json& health = json.at("health");
    LogRun end;
    end.realization = json.at("realization").get<int>();
    end.experiment = json.at("experiment").get<int>();
    end.samples = json.at("samples").get<std::uint64_t>();
    end.complete = json.at("complete").get<bool>();
    end.health.cycles = health.at("cycles").get<std::uint64_t>();
    end.health.late = health.at("late").get<std::uint64_t>();
    end.health.missing = health.at("missing").get<std::uint64_t>();
    end.health.marked = health.at("marked").get<std::uint64_t>();
    end.health.irregular = health.value("irregular", std::uint64_t{0});
    end.health.lost = health.value("lost", std::uint64_t{0});
    end.health.largest_lateness_ns = health.at("largest_lateness_ns").get<std::int64_t>();
    end.health.seconds = health.at("seconds").get<double>();
    if (json.contains("timing")) end.timing = timing_of(json.at("timing"));
    return end;
  });
}

std::string to_json(const SlogEnd& end) {
  return text_of({{"exit_code", end.exit_code}, {"message", end.message}});
}

SlogEnd parse_end(std::string_view text) {
  return parse(text, "end of the log", [](const Json& json) {
    return SlogEnd{json.at("exit_code").get<int>(), json.at("message").get<std::string>()};
  });
}

}  // namespace stageid
