#include "tools/watch/stage_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <fstream>
#include <thread>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_text.hpp"
#include "tools/terminal/json.hpp"
#include "tools/watch/watch_event.hpp"

namespace stageid {
namespace {

/// A model whose error is a larger share of the response gives sizes of changes that are as wrong.
constexpr double kDescribes = 0.2;

/// "1/year", "2/day", "0.001/period", as a number per period.
double false_alarms_per_period(const std::string& text, double period_s) {
  const std::array<std::pair<const char*, double>, 5> units = {{{"period", period_s},
                                                                {"hour", 3600.0},
                                                                {"day", 86400.0},
                                                                {"week", 604800.0},
                                                                {"year", 31557600.0}}};
  const std::size_t slash = text.find('/');
  double number = 0.0;
  const char* const end = text.data() + std::min(slash, text.size());
  if (slash != std::string::npos && std::from_chars(text.data(), end, number).ptr == end &&
      number > 0.0)
    for (const auto& [unit, seconds] : units)
      if (text.substr(slash + 1) == unit) return number * period_s / seconds;
  fail_request(
      "--false-alarms: got '{}'; expected NUMBER/period, /hour, /day, /week or /year, "
      "such as 1/year",
      text);
}

std::vector<EventField> fields_of(const Json& event) {
  std::vector<EventField> fields;
  for (const auto& [name, value] : event.items()) {
    if (name == "event") continue;
    if (value.is_number_integer()) fields.push_back({name, value.get<std::int64_t>()});
    if (value.is_number_float()) fields.push_back({name, value.get<double>()});
    if (value.is_string()) fields.push_back({name, value.get<std::string>()});
  }
  return fields;
}

/// The model behind the hold of the log, which may have another rate than the data of the fit.
AdditiveModel sampled_at(double rate_hz, AdditiveModel model) {
  model.sample_rate_hz = rate_hz;
  return model;
}

/// Waits for the next period of a log that is being written.
bool wait(double longest_s, const std::function<bool()>& go_on) {
  const auto until = std::chrono::steady_clock::now() +
                     std::chrono::duration<double>(std::clamp(longest_s, 0.05, 1.0));
  while (std::chrono::steady_clock::now() < until && go_on())
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  return go_on();
}

}  // namespace

StageWatch::StageWatch(WatchOptions options, const Console& console)
    : options_(std::move(options)), console_(console), model_(read_model(options_.model)) {
  false_alarms_per_period(options_.false_alarms, 1.0);
  state_ = state_of({});
}

void StageWatch::write_events(EventLog& events) {
  events_ = &events;
  std::ifstream file(events.path());
  for (std::string line; std::getline(file, line);) {
    auto event = Json::parse(line, nullptr, false);
    if (!event.is_object()) continue;
    event.erase("time_utc");
    told_before_.insert(json_line(event));
  }
}

void StageWatch::run(const std::filesystem::path& log, bool follow,
                     const std::function<bool(double)>& go_on) {
  double time_s = 0.0;
  const auto goes_on = [&] { return go_on(time_s); };
  while (follow && !WatchSource::has_begun(log))
    if (!wait(0.0, goes_on)) return;
  open(log, follow);
  do {
    while (const std::optional<WatchedPeriod> period = source_->next()) {
      add(*period);
      time_s = period->time_s;
      if (!goes_on()) break;
    }
  } while (goes_on() && source_->refresh() && wait(0.5 * period_s_, goes_on));
  if (tracks_) tracks_->commit(*tracker_);
}

std::array<double, 2> StageWatch::band() const {
  if (!options_.band_hz.empty()) return {options_.band_hz[0], options_.band_hz[1]};
  if (model_.fit.band_hz[1] > 0.0) return {model_.fit.band_hz[0], model_.fit.band_hz[1]};
  return {0.0, 0.5 * model_.sample_rate_hz};
}

TrackerOptions StageWatch::tracker_options() const {
  TrackerOptions options;
  options.learning_periods = options_.learn;
  if (options_.memory_s > 0.0) options.memory_periods = options_.memory_s / period_s_;
  options.false_alarms_per_period = false_alarms_per_period(options_.false_alarms, period_s_);
  return options;
}

void StageWatch::open(const std::filesystem::path& log, bool follow) {
  source_.emplace(model_, log, band(), follow);
  const double rate_hz = source_->info().sample_rate_hz;
  period_s_ = source_->info().period_samples / rate_hz;
  tracker_.emplace(sampled_at(rate_hz, model_), source_->frequency_hz(), tracker_options());
  if (!track_file_.empty())
    tracks_.emplace(track_file_, *tracker_, model_, options_.model, *source_);
}

void StageWatch::add(const WatchedPeriod& period) {
  if (period.other_excitation) tracker_->change_excitation();
  const TrackedPeriod tracked = tracker_->add(period.spectra);
  ++periods_;
  if (tracked.learning) ++learned_;
  if (tracks_) tracks_->add(period, tracked, *tracker_);
  if (tracked.change) tell(*tracked.change, period);
  if (!shown_) return;
  Json state = state_of(tracked);
  const std::lock_guard lock(mutex_);
  state_ = std::move(state);
  if (!tracked.learning)
    history_.add(period.time_s, tracker_->estimate(),
                 tracker_->covariance().diagonal().cwiseSqrt());
}

void StageWatch::tell(const StageChange& change, const WatchedPeriod& period) {
  stage_changed_ = stage_changed_ || is_of_stage(change.what.kind);
  Json event = change_json(change, *tracker_, model_, period, period_s_);
  console_.result("{:.6g} s: {}", period.time_s, event["text"].get<std::string>());
  if (events_ != nullptr && !told_before_.contains(json_line(event)))
    events_->write("change", fields_of(event));
  const std::lock_guard lock(mutex_);
  changes_.push_back(std::move(event));
}

Json StageWatch::state_of(const TrackedPeriod& tracked) const {
  Json json = {{"periods", periods_},
               {"skipped", source_ ? source_->skipped() : 0},
               {"learning", tracked.learning},
               {"statistic", tracked.largest_statistic},
               {"threshold", tracked.threshold},
               {"changes", changes_.size()}};
  json["tracked"] = tracker_ ? tracked_json(*tracker_, model_) : Json::array();
  json["noise"] = Json::array();
  for (Eigen::Index i = 0; i < model_.n_outputs(); ++i)
    json["noise"].push_back({{"channel", model_.outputs.name(i)},
                             {"name", describe({ChangeKind::noise, i, {}}, {}, model_)}});
  if (tracked.statistics.size() == 0) return json;
  const std::size_t properties = json["tracked"].size();
  for (std::size_t p = 0; p < properties; ++p)
    json["tracked"][p]["statistic"] = tracked.statistics[p];
  for (std::size_t i = 0; i < json["noise"].size(); ++i) {
    Json& sensor = json["noise"][i];
    sensor["statistic"] = tracked.statistics[properties + i];
    if (tracked.noise_power.size() > 0) sensor["power"] = tracked.noise_power[i];
  }
  return json;
}

std::string StageWatch::doubt() const {
  if (periods_ < options_.learn)
    return fmt::format(
        "{} of {} periods to learn from; nothing was watched. Record more periods, or use --learn",
        periods_, options_.learn);
  const ReferenceQuality& quality = tracker_->reference();
  const auto worst = [](const Eigen::VectorXd& error) {
    Eigen::Index sensor = 0;
    const double value = error.maxCoeff<Eigen::PropagateNaN>(&sensor);
    return std::pair(value, sensor);
  };
  if (const auto [error, sensor] = worst(quality.relative_error); !(error < kDescribes))
    return fmt::format(
        "the model {} does not describe the response of sensor '{}' ({:.2g} times the response "
        "remain); changes are not told reliably. Check this sensor, or identify the stage again",
        options_.model.string(), model_.outputs.name(sensor), error);
  // A change that was told is not told again.
  if (const auto [error, sensor] = worst(quality.model_error);
      !stage_changed_ && !(error < kDescribes))
    return fmt::format(
        "the stage differs from the model {} since the first period: {:.2g} times the response of "
        "sensor '{}' are not explained. The values above show how it differs; later changes are "
        "reported relative to this state. Use the model of this stage, or identify it again",
        options_.model.string(), error, model_.outputs.name(sensor));
  return "";
}

std::vector<std::string> StageWatch::lines() const {
  return tracker_ ? tracked_lines(*tracker_, model_) : std::vector<std::string>();
}

std::string StageWatch::summary() const {
  return fmt::format("{} periods, {} of them to learn from, {} skipped for marked samples: {}{}",
                     periods_, learned_, source_ ? source_->skipped() : 0,
                     changes_.empty() ? "no change" : counted(changes_.size(), "event"),
                     source_ && source_->was_stopped_early()
                         ? "; the measurement was stopped before its end"
                         : "");
}

Json StageWatch::json() const {
  return {{"model", options_.model.string()},
          {"periods", periods_},
          {"learning_periods", learned_},
          {"skipped_periods", source_ ? source_->skipped() : 0},
          {"changes", changes_},
          {"tracked", tracker_ ? tracked_json(*tracker_, model_) : Json::array()}};
}

Json StageWatch::state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

std::string StageWatch::history_json() const {
  std::unique_lock lock(mutex_);
  const TrackHistory history = history_;
  const Json changes = changes_;
  lock.unlock();
  return fmt::format(R"({{"history":{},"changes":{}}})", history.json(), in_ascii(changes));
}

}  // namespace stageid
