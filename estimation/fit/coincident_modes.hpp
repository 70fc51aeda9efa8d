#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Modes of rank one at the same frequency are one mode of higher rank. The data determine only the span of their
/// shapes, and separate fits of them do not converge. Such modes are fitted as one mode with their rank, and written
/// separately.
struct TiedModel {
  AdditiveModel model;
  std::vector<int> ranks;  ///< number of modes per submodel, as FitOptions::mode_ranks; 0: one
};

/// `tied` with modes `i` and `j` replaced by one between the two, their residues added. @pre both are modes, i < j
TiedModel with_tied(const TiedModel& tied, std::size_t i, std::size_t j);

/// Ties modes with equal denominators.
TiedModel with_coincident_tied(const AdditiveModel& model);

/// The rank-two mode `i` split into two of rank one at different frequencies, to first order in the data. With
/// residues B+ and B- of two modes a small h to either side, B = B+ + B- and C = (B+ - B-) h are
/// sum_k phi_k psi_k^T and sum_k delta_k phi_k psi_k^T. The delta_k are the eigenvalues of C B^-1 on the two shapes,
/// first for different frequencies, then for different damping ratios.
/// @returns nothing if they are complex: the data contradict two modes of rank one
/// @pre the mode has one numerator coefficient
std::optional<TiedModel> with_parted(const FrfEstimate& frf, const TiedModel& tied, std::size_t i,
                                     const FitOptions& options);

/// Splits the modes tied by `ranks` in the result of a fit: one mode per part of the singular value decomposition of
/// their residue, at the same frequency. Their numerators have no standard deviations.
void split_tied(const std::vector<int>& ranks, FitResult& fit);

}  // namespace stageid
