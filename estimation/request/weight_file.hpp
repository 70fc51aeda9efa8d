#pragma once

#include <filesystem>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The contiguous lines from which the band was selected.
struct WholeLines {
  Eigen::Index first = 0;  ///< index of the first line of the band
  Eigen::Index count = 0;  ///< 0: only those of the band
};

/// Reads the weights of docs/formats.md, on the lines of the band or on all lines, into `options`:
/// /weights [N x n_y x n_u], or /weight_matrices [N x n_c x n_c] complex.
/// @throws FileError; FormatError: shape, not finite, a matrix that is not Hermitian, both datasets or none, or too
/// large for memory (checked before reading); IndefiniteWeights: a negative weight, or a matrix that is not positive
/// semidefinite.
void read_weights(const std::filesystem::path& file, const FrfEstimate& frf, FitOptions& options,
                  WholeLines whole = {});

}  // namespace stageid
