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

/// One number, word or truth of an event.
struct EventField {
  std::string name;
  std::variant<std::int64_t, double, bool, std::string> value;
};

/// The events of an experiment as JSON lines beside its log (docs/formats.md): one object a line,
///   {"time_utc": "...", "event": "miss", ...}.
/// A line is written whole and at once, so that what happened before a crash can be read. May be
/// called from any thread but the loop's. A disk that fails does not stop the experiment: the first
/// failure is kept in error(), and no more is written.
class EventLog {
 public:
  /// Continues `file` or makes it. @throws FileError if it cannot be opened.
  explicit EventLog(const std::filesystem::path& file);
  EventLog(const EventLog&) = delete;
  EventLog& operator=(const EventLog&) = delete;

  void write(std::string_view event, const std::vector<EventField>& fields = {}) noexcept;

  /// The newest lines, oldest first, `most` of them at most (and 100).
  std::vector<std::string> latest(std::size_t most) const;
  /// Why nothing is written any more; empty if all is well.
  std::string error() const;

 private:
  struct Closer {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };
  void append(std::string line);

  std::filesystem::path path_;
  mutable std::mutex mutex_;  // of all below
  std::unique_ptr<std::FILE, Closer> file_;
  std::vector<std::string> latest_;
  std::string error_;
};

/// run.slog -> run.events.jsonl
std::filesystem::path event_log_of(const std::filesystem::path& log);

}  // namespace stageid
