#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

// Checks common to all log readers, with the same messages.

/// Every complete run has transient_periods and at least one more period, all whole. Realization and experiment
/// are not negative, and complete runs are unique.
/// @throws FormatError naming run and numbers.
void check_runs(const std::filesystem::path& file, const LogInfo& info,
                const std::vector<LogRun>& runs);

/// @throws std::invalid_argument if the index is out of range.
void check_run_index(const std::filesystem::path& file, const std::vector<LogRun>& runs,
                     std::size_t run);

/// @throws std::invalid_argument if the rows are outside the run.
void check_row_range(const std::filesystem::path& file, const LogRun& run, std::uint64_t first,
                     std::uint64_t count);

/// Resizes the matrices of `out`; allocates nothing if they have the right sizes.
void resize_samples(const LogInfo& info, std::uint64_t count, LogSamples& out);

/// Names the first number that is not finite in `count` rows of `samples`, beginning with row `from`.
/// @param first row of the run that is row 0 of `samples`   @throws FormatError always
[[noreturn]] void throw_not_finite(const std::filesystem::path& file, const LogInfo& info,
                                   const LogRun& run, std::uint64_t first,
                                   const LogSamples& samples, Eigen::Index from,
                                   Eigen::Index count);

}  // namespace stageid
