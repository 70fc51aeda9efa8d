#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

// What both log readers refuse in the same words.

/// Every complete run holds transient_periods and at least one more period, all whole; realization
/// and experiment are not negative; no two complete runs are the same one.
/// @throws FormatError naming run and numbers.
void check_runs(const std::filesystem::path& file, const LogInfo& info,
                const std::vector<LogRun>& runs);

/// @throws std::invalid_argument if there is no run of this index.
void check_run_index(const std::filesystem::path& file, const std::vector<LogRun>& runs,
                     std::size_t run);

/// @throws std::invalid_argument if rows outside the run are asked for.
void check_row_range(const std::filesystem::path& file, const LogRun& run, std::uint64_t first,
                     std::uint64_t count);

/// Gives the matrices of `out` their sizes; nothing is allocated if they have them.
void resize_samples(const LogInfo& info, std::uint64_t count, LogSamples& out);

/// `channel` counts actuators first, then sensors. @throws FormatError, always.
[[noreturn]] void throw_not_finite(const std::filesystem::path& file, const LogInfo& info,
                                   const LogRun& run, std::uint64_t row, std::size_t channel);

}  // namespace stageid
