#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace stageid {

/// A number, text or boolean of an event.
struct EventField {
  std::string name;
  std::variant<std::int64_t, double, bool, std::string> value;
};

/// The events of an experiment as JSON lines beside its log (docs/formats.md), one object per line:
///   {"time_utc": "...", "event": "miss", ...}.
/// Lines are written immediately and completely, so that the events before a crash can be read. Any thread
/// except the loop's may call it. A failing disk does not stop the experiment: the first failure is kept in
/// error(), and writing stops.
class EventLog {
 public:
  /// Continues or creates `file`. @throws FileError if it cannot be opened.
  explicit EventLog(const std::filesystem::path& file);
  EventLog(EventLog&&) = delete;

  void write(std::string_view event, const std::vector<EventField>& fields = {}) noexcept;

  const std::filesystem::path& path() const noexcept { return path_; }
  /// The newest lines, oldest first; at most `most`, and at most 100.
  std::vector<std::string> latest(std::size_t most) const;
  /// Why writing has stopped; empty if it has not.
  std::string error() const;

 private:
  void append(std::string line);

  std::filesystem::path path_;
  mutable std::mutex mutex_;  // guards all members below
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file_;
  std::vector<std::string> latest_;
  std::string error_;
};

/// run.slog -> run.events.jsonl
std::filesystem::path event_log_of(const std::filesystem::path& log);

}  // namespace stageid
