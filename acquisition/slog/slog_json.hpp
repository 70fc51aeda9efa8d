#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// JSON payloads of a native log other than LogInfo (slog_format.hpp).
struct SlogRunBegin {
  int realization = 0;
  int experiment = 0;
  std::string started_utc;
  std::vector<int> excitation_columns;  ///< strictly increasing
};

struct SlogRunEnd {
  int realization = 0;
  int experiment = 0;
  std::uint64_t samples = 0;
  bool complete = false;
  RunHealth health;
  RunTiming timing;
};

struct SlogEnd {
  int exit_code = 0;
  std::string message;
};

// Converts values to text. @throws std::invalid_argument if a string is not UTF-8 or metadata are not JSON.
std::string to_json(const LogInfo& info);
std::string to_json(const SlogRunBegin& begin);
std::string to_json(const SlogRunEnd& end);
std::string to_json(const SlogEnd& end);

// Converts text to values. @throws std::invalid_argument if a key is missing or has another type.
LogInfo parse_log_info(std::string_view json);
SlogRunBegin parse_run_begin(std::string_view json);
SlogRunEnd parse_run_end(std::string_view json);
SlogEnd parse_end(std::string_view json);

}  // namespace stageid
