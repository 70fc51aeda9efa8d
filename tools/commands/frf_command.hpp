#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tools/steps/frf_step.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid frf LOG... -o frf.h5
class FrfCommand {
 public:
  FrfCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  FrfStep estimate(const FrfOptions& options) const;

  Console& console_;
  std::vector<std::filesystem::path> logs_;
  std::filesystem::path output_;
  std::filesystem::path stage_;
  std::filesystem::path fft_wisdom_;
  bool no_health_ = false;
  std::vector<std::string> inputs_;
  std::vector<std::string> outputs_;
  std::vector<int> realizations_;
  std::optional<int> transient_periods_;
  std::optional<double> delay_s_;
  std::string method_ = "periodic";
  std::string periods_ = "consistent";
  int covariance_lines_ = 1;
  std::string covariance_ = "diagonal";
  std::string compensate_ = "none";
  int threads_ = 0;
};

}  // namespace stageid
