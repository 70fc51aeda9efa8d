#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/model/additive_model.hpp"

namespace stageid::test {

/// The least standard deviations that any unbiased estimate can have; one entry a submodel.
struct CramerRaoBound {
  Eigen::VectorXd frequency_std_hz;  ///< 0 if the submodel is not a mode
  Eigen::VectorXd damping_std;
  std::vector<Eigen::MatrixXd> numerator_std;  ///< of B_0, n_y x n_u
};

/// The bound of frequencies, damping ratios, one delay of all channels and all numerators, for
/// independent circular noise of the given variance (n_c x N):
///   Cov = [2 sum Re{J^H C^-1 J}]^-1.
/// The frequencies and damping ratios are the unknowns themselves here; J comes from differences of
/// reference_response(), and the numerators of a channel are eliminated by QR of its tall matrix, so
/// that nothing of the library's derivatives, normal equations or delta method is used.
/// @pre one numerator coefficient a submodel, submodels without poles or with one mode, equal delays
CramerRaoBound cramer_rao_bound(const AdditiveModel& truth, const Eigen::VectorXd& frequency_hz,
                                HoldModel hold, const Eigen::MatrixXd& variance);

}  // namespace stageid::test
