#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "acquisition/record/event_log.hpp"
#include "estimation/tracking/model_tracker.hpp"
#include "tools/commands/command_line.hpp"
#include "tools/commands/commands.hpp"
#include "tools/terminal/exit_code.hpp"
#include "tools/terminal/interrupt.hpp"
#include "tools/watch/track_file.hpp"
#include "tools/watch/watch_event.hpp"
#include "tools/watch/watch_source.hpp"

namespace stageid {
namespace {

/// stageid watch MODEL LOG
struct WatchFlags {
  std::filesystem::path model;
  std::filesystem::path log;
  std::filesystem::path output;
  std::filesystem::path events;
  std::vector<double> band_hz;
  std::string false_alarms = "1/year";
  double memory_s = 0.0;  // 0: 100 periods
  int learn = TrackerOptions().learning_periods;
  bool follow = false;
};

/// "1/year", "2/day", "0.001/period", as a number per period.
double false_alarms_per_period(const std::string& text, double period_s) {
  const std::array<std::pair<const char*, double>, 5> units = {{{"period", period_s},
                                                                {"hour", 3600.0},
                                                                {"day", 86400.0},
                                                                {"week", 604800.0},
                                                                {"year", 31557600.0}}};
  const std::size_t slash = text.find('/');
  double number = 0.0;
  if (slash != std::string::npos && CLI::detail::lexical_cast(text.substr(0, slash), number) &&
      number > 0.0)
    for (const auto& [unit, seconds] : units)
      if (text.substr(slash + 1) == unit) return number * period_s / seconds;
  throw std::invalid_argument(
      fmt::format("--false-alarms: got '{}'; expected NUMBER/period, /hour, /day, /week or /year, "
                  "such as 1/year",
                  text));
}

class Watch {
 public:
  Watch(const WatchFlags& flags, Console& console)
      : flags_(flags),
        console_(console),
        model_(read_model(flags.model)),
        source_(model_, flags.log, band(), flags.follow),
        period_s_(source_.info().period_samples / source_.info().sample_rate_hz),
        tracker_(sampled_at(source_.info().sample_rate_hz), source_.frequency_hz(), options()) {
    if (!flags.output.empty()) tracks_.emplace(flags.output, tracker_, model_, flags.model);
    if (!flags.events.empty()) events_.emplace(flags.events);
  }

  void run() {
    const ControlledStop stop;
    Progress progress(console_, "watch", "s of stage time/s");
    do {
      while (const std::optional<WatchedPeriod> period = source_.next()) {
        add(*period);
        progress.update(period->time_s, 0.0);
        if (interrupt_flag()) break;
      }
    } while (!interrupt_flag() && source_.refresh() && wait());
    finish();
  }

 private:
  std::array<double, 2> band() const {
    if (!flags_.band_hz.empty()) return {flags_.band_hz[0], flags_.band_hz[1]};
    if (model_.fit.band_hz[1] > 0.0) return {model_.fit.band_hz[0], model_.fit.band_hz[1]};
    return {0.0, 0.5 * model_.sample_rate_hz};
  }

  /// The model behind the hold of the log, which may have another rate than the data of the fit.
  AdditiveModel sampled_at(double rate_hz) const {
    AdditiveModel model = model_;
    model.sample_rate_hz = rate_hz;
    return model;
  }

  TrackerOptions options() const {
    TrackerOptions options;
    options.learning_periods = flags_.learn;
    if (flags_.memory_s > 0.0) options.memory_periods = flags_.memory_s / period_s_;
    options.false_alarms_per_period = false_alarms_per_period(flags_.false_alarms, period_s_);
    return options;
  }

  void add(const WatchedPeriod& period) {
    if (period.other_excitation) tracker_.change_excitation();
    const TrackedPeriod state = tracker_.add(period.spectra);
    ++periods_;
    if (state.learning) ++learned_;
    if (tracks_) tracks_->add(period, state, tracker_);
    if (!state.change) return;
    if (is_of_stage(state.change->what.kind)) console_.exit_code = kNotTrustworthy;
    nlohmann::ordered_json event = change_json(*state.change, tracker_, model_, period, period_s_);
    console_.result(fmt::format("{:.6g} s: {}", period.time_s, event["text"].get<std::string>()));
    if (events_) events_->write("change", fields_of(event));
    changes_.push_back(std::move(event));
  }

  static std::vector<EventField> fields_of(const nlohmann::ordered_json& event) {
    std::vector<EventField> fields;
    for (const auto& [name, value] : event.items()) {
      if (name == "event") continue;
      if (value.is_number_integer()) fields.push_back({name, value.get<std::int64_t>()});
      if (value.is_number_float()) fields.push_back({name, value.get<double>()});
      if (value.is_string()) fields.push_back({name, value.get<std::string>()});
    }
    return fields;
  }

  /// For the next period of a log that is being written.
  bool wait() const {
    const auto until = std::chrono::steady_clock::now() +
                       std::chrono::duration<double>(std::clamp(0.5 * period_s_, 0.05, 1.0));
    while (std::chrono::steady_clock::now() < until && !interrupt_flag())
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    return !interrupt_flag();
  }

  void finish() {
    if (tracks_) tracks_->commit();
    if (periods_ < flags_.learn) {
      console_.exit_code = kNotTrustworthy;
      console_.warning(
          fmt::format("{}: {} of {} periods to learn from; nothing was watched. Record more "
                      "periods, or use --learn",
                      flags_.log.string(), periods_, flags_.learn));
    }
    for (const std::string& line : tracked_lines(tracker_, model_)) console_.result(line);
    console_.result(
        fmt::format("{} periods, {} of them to learn from, {} skipped for marked samples: {}",
                    periods_, learned_, source_.skipped(),
                    changes_.empty() ? "no change" : counted(changes_.size(), "event")));
    console_.result({{"model", flags_.model.string()},
                     {"log", flags_.log.string()},
                     {"periods", periods_},
                     {"learning_periods", learned_},
                     {"skipped_periods", source_.skipped()},
                     {"changes", changes_},
                     {"tracked", tracked_json(tracker_, model_)}});
    if (interrupt_flag()) console_.exit_code = kInterrupted;
  }

  const WatchFlags& flags_;
  Console& console_;
  AdditiveModel model_;
  WatchSource source_;
  double period_s_;
  ModelTracker tracker_;
  std::optional<TrackFile> tracks_;
  std::optional<EventLog> events_;
  int periods_ = 0;
  int learned_ = 0;
  nlohmann::ordered_json changes_ = nlohmann::ordered_json::array();
};

void watch(const WatchFlags& flags, Console& console) { Watch(flags, console).run(); }

}  // namespace

void watch_command(CLI::App& app, Console& console) {
  auto [command, flags] = add_command(
      app, console, "watch", "Track a working stage around its model; tell what changes", watch);
  command.add_option("model", flags.model, "model.json")->required();
  command.add_option("log", flags.log, "log of the working stage (.slog or .h5)")->required();
  command.add_flag("--follow", flags.follow,
                   "the log (.slog) is being written: wait for more until it ends");
  command.add_option("-o,--output", flags.output, "watch.h5: what was tracked, a row per period");
  command.add_option("--events", flags.events, "JSON lines of the changes, written as they happen");
  command.add_option("--band", flags.band_hz, "LOW HIGH, Hz; default: the band of the fit")
      ->expected(2);
  command
      .add_option("--learn", flags.learn,
                  "periods without change, from which noise and reference are learned")
      ->check(CLI::Range(4, 10000))
      ->capture_default_str();
  command
      .add_option("--memory", flags.memory_s,
                  "s; after this time the weight of a period is 1/e; default: 100 periods")
      ->check(kPositive);
  command
      .add_option("--false-alarms", flags.false_alarms,
                  "rate of alarms without change: NUMBER/period, /hour, /day, /week or /year")
      ->capture_default_str();
}

}  // namespace stageid
