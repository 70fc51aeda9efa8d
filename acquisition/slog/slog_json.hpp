#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "acquisition/record/log_info.hpp"

namespace stageid {

/// JSON payloads of a native log other than LogInfo (slog_format.hpp).
struct SlogRunBegin : LogRun {
  std::vector<int> excitation_columns;  ///< strictly increasing
};

struct SlogEnd {
  int exit_code = 0;
  std::string message;
};

// Converts values to text. @throws std::invalid_argument if a string is not UTF-8 or metadata are not JSON.
std::string to_json(const LogInfo& info);
std::string run_begin_json(const SlogRunBegin& begin);
std::string run_end_json(const LogRun& run);
std::string to_json(const SlogEnd& end);

// Converts text to values. @throws std::invalid_argument if a key is missing or has another type.
LogInfo parse_log_info(std::string_view json);
SlogRunBegin parse_run_begin(std::string_view json);
LogRun parse_run_end(std::string_view json);
SlogEnd parse_end(std::string_view json);

}  // namespace stageid
