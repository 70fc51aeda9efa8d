#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frf/periods/health_finding.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// Progress of reading logs is shown in megabytes.
inline constexpr double kMegabytesPerByte = 1.0 / 1e6;

struct FrfStep {
  FrfEstimate frf;
  double seconds = 0.0;
  double bytes = 0.0;             ///< of samples that were read
  std::vector<Finding> findings;  ///< on the health of the data, if examined
};

/// References for the health check of the data.
struct HealthRequest {
  bool wanted = true;
  std::filesystem::path stage_file;  ///< empty: the one in the log
};

/// Estimates, shows progress, and completes the provenance: configuration, seeds, identity of the request
/// (frf_request_id()), names of the logs, and the findings on the health of the data, which are examined in the same pass. The result
/// does not depend on directory, time or threads.
/// @throws FileError, FormatError, std::invalid_argument, Interrupted
FrfStep estimate_frf(const std::vector<const LogReader*>& logs, FrfOptions options,
                     const HealthRequest& health, const Console& console);
/// The same for log files.
FrfStep estimate_frf(const std::vector<std::filesystem::path>& files, const FrfOptions& options,
                     const HealthRequest& health, const Console& console);

/// Identifies a request: version, options and the experiment metadata of the logs. Two estimates with equal identity
/// from the same samples are equal.
std::string frf_request_id(const std::vector<const LogReader*>& logs, const FrfOptions& options);

/// "request_id" of a provenance; empty if there is none.
std::string request_id_of(const std::string& provenance_json);

/// One line for people: "4 x 13 on 4000 lines, 0.25 ... 1999.75 Hz, 2 realizations x 3 periods".
std::string describe(const FrfEstimate& frf);

}  // namespace stageid
