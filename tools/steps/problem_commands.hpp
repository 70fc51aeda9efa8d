#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "tools/steps/problem.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// The files of a result, which the commands of its problems name; empty: unknown.
struct ResultFiles {
  std::filesystem::path experiment;  ///< of `identify`
  std::filesystem::path directory;   ///< of `identify`
  std::filesystem::path log;
  std::filesystem::path frf;
  std::filesystem::path model;
};

/// "stageid fit FRF -o MODEL FLAGS" for a shell.
/// @param flags "options.flags" of a provenance: {"--band": "30 2000", ...}
/// @param changed flags with values, instead of those of the same name
std::string fit_command_line(const std::filesystem::path& frf, const std::filesystem::path& model,
                             const Json& flags, const std::string& changed = "");

/// Adds the commands for problems of a measured response or of a fit to it.
/// @param files those that the provenance names are added if they are beside the others
/// @param model null: not fitted
void add_commands(std::vector<Problem>& problems, ResultFiles files,
                  const std::string& frf_provenance_json, const AdditiveModel* model);
/// The same for the model's own response.
void add_commands(std::vector<Problem>& problems, ResultFiles files, const AdditiveModel& model);

}  // namespace stageid
