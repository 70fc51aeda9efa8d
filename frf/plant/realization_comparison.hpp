#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/periods/realization_change.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Compares the responses G^[m] of the realizations, which a linear plant has in common. A channel that is recorded
/// differently in one realization would otherwise appear as distortion of the plant.
///
/// The reference is the median over the realizations, entry by entry; of two, the first one. Let D be the deviation of
/// G^[m] from it, with weights w = 1 / (2 v), v the noise of one realization. If the weighted square of D exceeds
/// 1.5 times its expectation, D is searched for the change of one channel (row or column), or of all, that explains
/// most: a factor, a delay of up to 4 samples, or the exchange of two. It is undone, and the search is repeated.
/// A change is accepted on four conditions:
///   - It explains 30 % of the misfit of its entries, an exchange half of both. A factor or a delay is estimated from
///     every second line for this, and explains the others.
///   - All changes together explain half of the misfit.
///   - It is 6 standard deviations from none, of the noise and of what it leaves unexplained. Distortions and drifts
///     have other phases and sizes on every line.
///   - It is large enough to matter: 2 % for a factor, 2 us for a delay.
/// Memory: at most 400 lines per realization.
class RealizationComparison {
 public:
  RealizationComparison(Eigen::Index outputs, Eigen::Index inputs, Eigen::Index lines);

  /// Call before the lines of a realization (counted from 0) are added.
  void begin(int realization);
  /// Adds line k; different lines may be added concurrently.
  void add(const Eigen::MatrixXcd& G, Eigen::Index k);

  /// @param frf finished, on the same lines
  RealizationDifferences find(const FrfEstimate& frf) const;

 private:
  Eigen::Index outputs_;
  Eigen::Index inputs_;
  Eigen::Index every_;  // every such line is kept
  Eigen::Index kept_;
  std::vector<int> realization_;
  std::vector<Eigen::MatrixXcd> responses_;  // vec(G) x kept lines
};

}  // namespace stageid
