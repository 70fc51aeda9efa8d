#include "tools/dashboard/metrics.hpp"

#include <fmt/format.h>

#include <iterator>
#include <utility>

#include "acquisition/files/json_text.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {
namespace {

/// A family of samples with its head.
class Metric {
 public:
  Metric(std::string& text, const char* name, const char* type, const char* help)
      : text_(text), name_(name) {
    print("# HELP stageid_{} {}\n# TYPE stageid_{} {}\n", name, help, name, type);
  }
  /// @param labels 'name="value",...,'
  void add(const SortedJson& value, const std::string& labels = "") {
    if (!value.is_number()) return;
    print("stageid_{}", name_);
    if (!labels.empty()) print("{{{}}}", labels);
    print(" {}\n", value.get<double>());
  }

 private:
  template <typename... Values>
  void print(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }
  std::string& text_;
  const char* name_;
};

/// A comma may be last.
std::string label(const char* name, const std::string& value) {
  std::string escaped;
  for (const char c : value) {
    if (c == '\\' || c == '"' || c == '\n') escaped += '\\';
    escaped += c == '\n' ? 'n' : c;
  }
  return fmt::format("{}=\"{}\",", name, escaped);
}

/// One sample per property that has `key`.
void add_properties(const SortedJson& list, const char* key, Metric metric) {
  for (const SortedJson& property : list) {
    std::string labels;
    for (const char* name : {"kind", "name"})
      if (property.contains(name)) labels += label(name, property[name].get<std::string>());
    metric.add(property.value(key, SortedJson()), labels);
  }
}

void add_watch(const SortedJson& watch, std::string& text) {
  Metric(text, "watch_periods_total", "counter", "Periods watched.").add(watch["periods"]);
  Metric(text, "watch_skipped_periods_total", "counter", "Periods with marked samples.")
      .add(watch["skipped"]);
  Metric(text, "watch_learning", "gauge", "1 while noise and reference are learned.")
      .add(watch["learning"].get<bool>() ? 1 : 0);
  Metric(text, "watch_changes_total", "counter", "Changes told.").add(watch["changes"]);
  Metric(text, "watch_threshold", "gauge", "Statistic at which a change is told.")
      .add(watch["threshold"]);
  Metric(text, "watch_statistic", "gauge", "Largest statistic of the last period.")
      .add(watch["statistic"]);
  add_properties(watch["tracked"], "change",
                 {text, "tracked_change", "gauge",
                  "Change from the model: relative, of the delay in seconds."});
  add_properties(watch["tracked"], "deviation",
                 {text, "tracked_deviation", "gauge", "Standard deviation of the change."});
  add_properties(watch["tracked"], "statistic",
                 {text, "tracked_statistic", "gauge", "Statistic of a change of this property."});
  add_properties(watch["noise"], "power",
                 {text, "noise_power", "gauge", "Noise of a sensor, relative to the learned."});
  add_properties(watch["noise"], "statistic",
                 {text, "noise_statistic", "gauge", "Statistic of a change of this noise."});
}

}  // namespace

std::string metrics_text(std::string_view state) {
  const SortedJson json = parse_json_object<SortedJson>(state);
  std::string text;
  if (json.contains("state"))
    Metric(text, "state", "gauge", "1 with the state of the measurement.")
        .add(1, label("state", json["state"].get<std::string>()));
  const SortedJson health = json.value("health", SortedJson::object());
  for (const auto& [name, help] :
       {std::pair("cycles", "Rows recorded."), std::pair("late", "Cycles that were late."),
        std::pair("missing", "Cycles without a sample."),
        std::pair("marked", "Samples marked as invalid."),
        std::pair("irregular", "Cycles beyond the limit of jitter.")})
    Metric(text, fmt::format("{}_total", name).c_str(), "counter", help)
        .add(health.value(name, SortedJson()));
  Metric(text, "runs_done_total", "counter", "Complete runs.")
      .add(json.value("runs_done", SortedJson()));
  Metric(text, "runs", "gauge", "Runs of the experiment.")
      .add(json.value("runs_total", SortedJson()));
  Metric(text, "exit_code", "gauge", "Exit code, at the end.")
      .add(json.value("exit_code", SortedJson()));
  if (const SortedJson watch = json.value("watch", SortedJson()); watch.is_object())
    add_watch(watch, text);
  return text;
}

}  // namespace stageid
