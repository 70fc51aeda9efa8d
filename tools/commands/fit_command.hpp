#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/fit/fit_flags.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid fit FRF -o model.json
class FitCommand {
 public:
  FitCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  FitRequest checked_request() const;
  void require_covariance_file() const;

  Console& console_;
  std::filesystem::path frf_;
  std::filesystem::path output_;
  std::filesystem::path covariance_;  ///< empty: not requested
  FitFlags flags_;
  FitRequest request_;  ///< only its numbers
  std::vector<double> band_hz_;
  std::uint64_t seed_ = 0;
};

}  // namespace stageid
