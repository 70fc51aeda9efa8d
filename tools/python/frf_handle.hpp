#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A frequency response in Python, and its name in the provenance of a fit.
struct FrfHandle {
  explicit FrfHandle(FrfEstimate estimate, std::string its_name = "memory",
                     std::string its_fingerprint = "")
      : frf(std::move(estimate)),
        name(std::move(its_name)),
        fingerprint(std::move(its_fingerprint)) {}

  FrfEstimate frf;
  std::string name;         ///< of its file, else "memory"
  std::string fingerprint;  ///< of that file; empty: not from a file
};

/// @throws FileError, FormatError
FrfHandle read_frf_handle(const std::filesystem::path& file);

/// Identifies the content of a response without a file: frequencies, response and variances.
std::string fingerprint_of_content(const FrfEstimate& frf);

}  // namespace stageid
