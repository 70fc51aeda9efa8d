#include "acquisition/record/event_log.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <nlohmann/json.hpp>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/json_text.hpp"
#include "acquisition/files/system_reason.hpp"
#include "acquisition/record/utc_time.hpp"

namespace stageid {

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kKept = 100;

std::string line_of(std::string_view event, const std::vector<EventField>& fields) {
  Json json = {{"time_utc", utc_now_ms()}, {"event", event}};
  for (const EventField& field : fields)
    std::visit([&](const auto& value) { json[field.name] = value; }, field.value);
  return json_line(json);
}

}  // namespace

EventLog::EventLog(const std::filesystem::path& file)
    : path_(file), file_(std::fopen(file.c_str(), "ae"), &std::fclose) {
  if (!file_) fail_file(file, "cannot be written: {}", system_reason(errno));
}

void EventLog::write(std::string_view event, const std::vector<EventField>& fields) noexcept {
  try {
    append(line_of(event, fields));
  } catch (const std::exception& problem) {
    const std::lock_guard lock(mutex_);
    if (error_.empty()) error_ = problem.what();
  }
}

void EventLog::append(std::string line) {
  const std::lock_guard lock(mutex_);
  if (latest_.size() == kKept) latest_.erase(latest_.begin());
  latest_.push_back(line);
  if (!error_.empty()) return;
  line += '\n';
  if (std::fwrite(line.data(), 1, line.size(), file_.get()) == line.size() &&
      std::fflush(file_.get()) == 0)
    return;
  error_ = fmt::format("{}: cannot be written: {}; later events are missing from it",
                       path_.string(), std::strerror(errno));
}

std::vector<std::string> EventLog::latest(std::size_t most) const {
  const std::lock_guard lock(mutex_);
  const std::size_t count = std::min(most, latest_.size());
  return {latest_.end() - count, latest_.end()};
}

std::string EventLog::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

std::filesystem::path event_log_of(const std::filesystem::path& log) {
  std::filesystem::path file = log;
  return file.replace_extension(".events.jsonl");
}

}  // namespace stageid
