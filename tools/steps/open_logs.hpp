#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"

namespace stageid {

/// Progress of reading logs is shown in megabytes.
inline constexpr double kBytesPerMegabyte = 1e6;

/// Several logs that are read together. @throws as open_log()
class OpenLogs {
 public:
  explicit OpenLogs(const std::vector<std::filesystem::path>& files) {
    for (const std::filesystem::path& file : files) {
      readers_.push_back(open_log(file));
      logs_.push_back(readers_.back().get());
    }
  }
  const std::vector<const LogReader*>& logs() const noexcept { return logs_; }

 private:
  std::vector<std::unique_ptr<LogReader>> readers_;
  std::vector<const LogReader*> logs_;
};

}  // namespace stageid
