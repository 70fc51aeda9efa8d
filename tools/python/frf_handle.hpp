#pragma once

#include <filesystem>
#include <string>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A frequency response in Python, and its name in the provenance of a fit.
struct FrfHandle {
  FrfEstimate frf;
  std::string name = "memory";   ///< of its file, else "memory"
  std::string fingerprint = "";  ///< of that file; empty: not from a file
};

/// @throws FileError, FormatError
FrfHandle read_frf_handle(const std::filesystem::path& file);

}  // namespace stageid
