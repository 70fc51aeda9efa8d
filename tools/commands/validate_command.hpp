#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "estimation/modal/validation.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid validate MODEL FRF|LOG|MODE_SHAPES
class ValidateCommand {
 public:
  ValidateCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  /// @throws FormatError if the model has a channel that the data lack
  void require_channels(const std::vector<std::string>& of_data,
                        const std::vector<std::string>& of_model, const char* kind) const;

  Console& console_;
  std::filesystem::path model_;
  std::filesystem::path data_;
  std::filesystem::path stage_;
  std::vector<double> band_hz_;
  int threads_ = 0;
};

std::vector<std::string> validation_lines(const Validation& validation);
nlohmann::ordered_json validation_json(const Validation& validation);

}  // namespace stageid
