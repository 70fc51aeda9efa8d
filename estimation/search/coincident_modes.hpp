#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Modes of rank one at one place are one mode of a higher rank: which shapes they have there is not in the data,
/// only what they span, and a fit of each by itself never comes to rest. A model with such modes is fitted as one
/// mode each with its rank, and written with them apart.
struct TiedModel {
  AdditiveModel model;
  std::vector<int>
      ranks;  ///< how many modes every submodel stands for, as FitOptions::mode_ranks; 0: one
};

/// `tied` with modes `i` and `j` at a place between the two, their residues added. @pre both are modes, i < j
TiedModel with_tied(const TiedModel& tied, std::size_t i, std::size_t j);

/// Modes whose denominators are the same, tied.
TiedModel with_coincident_tied(const AdditiveModel& model);

/// The rank-two mode `i` as two of rank one at places of their own, where the data put them to first order: with
/// residues B+ and B- of two modes a small h to either side, B = B+ + B- and C = (B+ - B-) h are
/// sum_k phi_k psi_k^T and sum_k delta_k phi_k psi_k^T; delta_k are the eigenvalues of C B^-1 on the two shapes, first
/// with the frequencies apart, then the damping ratios.
/// @returns nothing if they are complex: two modes of rank one are not what the data show
/// @pre the mode has one numerator coefficient
std::optional<TiedModel> with_parted(const FrfEstimate& frf, const TiedModel& tied, std::size_t i,
                                     const FitOptions& options);

/// Writes the modes of a fit apart that `ranks` ties: the parts of the singular value decomposition of their residue,
/// one mode each at the same place. Their numerators have no deviations.
void split_tied(const std::vector<int>& ranks, FitResult& fit);

}  // namespace stageid
