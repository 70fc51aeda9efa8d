#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "estimation/channel_equations.hpp"
#include "frf/frf_estimate.hpp"

namespace stageid {

/// Correlation of the outputs' noise from the FRF's residual covariance, R_k(y, z) = E e_y conj(e_z)
/// over the deviations. Its numbers are made where they are used: n_y^2 of them a line are as many as
/// the data where there are as many outputs as inputs.
class OutputCorrelation {
 public:
  OutputCorrelation() = default;  ///< not known
  /// Not known if the FRF has no residual covariance. `frf` must outlive it.
  explicit OutputCorrelation(const FrfEstimate& frf);

  bool known() const noexcept { return re_ != nullptr; }
  /// R(y, z) on some lines. @pre known(), y and z differ (R(y, y) is one)
  void between(Eigen::Index y, Eigen::Index z, LineRange lines, Eigen::ArrayXd& re,
               Eigen::ArrayXd& im) const;

 private:
  Eigen::Index n_y_ = 0;
  const Eigen::MatrixXd* re_ = nullptr;
  const Eigen::MatrixXd* im_ = nullptr;
};

/// Columns of all outputs of one input on some lines, one matrix (lines x n) an output.
struct OutputColumns {
  std::vector<Eigen::MatrixXd> re;
  std::vector<Eigen::MatrixXd> im;
};

/// On every line the outputs of X combined, Y_y = sum_z R(y, z) X_z: with X = C_diag^1/2 W J of all
/// outputs,  sum_y X_y^H Y_y = J^H W C W J.
OutputColumns correlated(const OutputCorrelation& correlation, const OutputColumns& X,
                         LineRange lines);

/// The columns X of an output on some lines, lines x n.
using ColumnsOfOutput = std::function<void(Eigen::Index output, LineRange lines,
                                           Eigen::MatrixXd& re, Eigen::MatrixXd& im)>;

/// sum_k Re{X^H R X} over all outputs and lines, n x n, in tiles of lines.
/// @param n columns of an output   @param use sees R X of every tile; may be nothing
Eigen::MatrixXd correlated_gram(
    const FitProblem& problem, const OutputCorrelation& correlation, Eigen::Index n,
    const ColumnsOfOutput& columns,
    const std::function<void(LineRange lines, const OutputColumns& Y)>& use = {});

}  // namespace stageid
