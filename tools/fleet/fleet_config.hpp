#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "estimation/request/fit_request.hpp"
#include "excitation/words/words.hpp"
#include "frf/response/frf_options.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// Which name a stage has in the store.
enum class StageName : std::uint8_t { log, folder };
template <>
inline constexpr std::array kWords<StageName> = {"log", "folder"};

/// Content of a fleet file; paths are relative to the current directory.
struct FleetConfig {
  std::filesystem::path file;
  std::vector<std::string> logs;  ///< patterns with *, ? and [...]
  std::filesystem::path table;    ///< empty: none
  std::filesystem::path store;
  std::filesystem::path results;  ///< folder of the jobs' folders
  StageName stage_name = StageName::log;
  std::vector<std::pair<std::string, std::string>> tags;  ///< of every identification
  FrfOptions frf;
  FitRequest fit;
  int validation_realization = -1;  ///< 0-based; -1: none is held back
  std::string identification;       ///< canonical text of everything that determines a result
};

/// @throws FileError, FormatErrors "FILE:LINE:COLUMN: problem. Remedy."
FleetConfig load_fleet_config(const std::filesystem::path& file);

/// The keys of a fleet file. Used by `stageid config schema`.
void describe_fleet_keys(ConfigVisitor& visitor);

}  // namespace stageid
