#pragma once

#include <filesystem>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The lines that the band was taken from, all in a row.
struct WholeLines {
  Eigen::Index first = 0;  ///< of them the band's first
  Eigen::Index count = 0;  ///< 0: those of the band
};

/// Reads the weights of docs/formats.md, on the lines of the band or on the whole ones, into `options`:
/// /weights [N x n_y x n_u], or /weight_matrices [N x n_c x n_c] complex.
/// @throws FileError; FormatError: shape, not finite, a matrix that is not Hermitian, both datasets or
///         none, too large for memory, before it is read; IndefiniteWeights: a weight that is negative, a
///         matrix that is not positive semidefinite.
void read_weights(const std::filesystem::path& file, const FrfEstimate& frf, FitOptions& options,
                  WholeLines whole = {});

}  // namespace stageid
