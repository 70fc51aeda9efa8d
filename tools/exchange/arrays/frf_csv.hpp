#pragma once

#include <filesystem>
#include <string>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A frequency response as a table with one line per frequency. Columns: frequency_hz, then per channel, outputs
/// first, "real OUTPUT/INPUT [m/N]" and "imaginary ...", and if known "noise_variance ... [(m/N)^2]" and
/// "total_variance ...", E|error|^2 of the complex response. Lines that begin with # contain format and realizations;
/// one of them is a JSON object with names, units, sample rate, hold and degrees of freedom. Numbers are the shortest
/// that read back to the same double.
std::string frf_csv(const FrfEstimate& frf);

/// Whether a .csv file has the columns of frf_csv().
/// @throws FileError
bool is_frf_csv(const std::filesystem::path& file);

/// The reverse of frf_csv(). Without the JSON comment, names and units are read from the titles of the columns.
/// Covariances and provenance are not part of the table. The result is not yet checked with check().
/// @throws FileError, FormatError
FrfEstimate read_frf_csv(const std::filesystem::path& file);

}  // namespace stageid
