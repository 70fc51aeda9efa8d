#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "estimation/products/equation_method.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Knowledge of the variance of the data.
enum class VarianceKnowledge : std::uint8_t {
  weights,  ///< W is its inverse, known or estimated: maximum likelihood
  given,    ///< another variance than that of the weights: sandwich form
  none      ///< proportional to 1/W, scaled by the residual
};

/// Columns of all outputs of one input on some lines, 2 n_y rows per line: the real parts of all outputs, then the
/// imaginary parts. All numbers that are correlated are neighbours then.
using OutputColumns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The columns of one output, lines x n. @param y 0-based, of n_y
SplitMatrix columns_of_output(const OutputColumns& columns, Eigen::Index y, Eigen::Index n_y);

/// Correlation of the noise of a response, S_k kron R_k on line k: that of the outputs from the residual covariance of
/// the FRF, that of the inputs from its input factor, both over the deviations. A disturbance force moves several
/// outputs at once, and in closed loop the controller repeats its effect on one input with the others. The numbers are
/// computed where they are used, since per line they are as many as the data or more.
/// Source: docs/theory.md, section 3, Cov(vec G) = S kron C_E.
class NoiseCorrelation {
 public:
  NoiseCorrelation() = default;  ///< unknown
  /// Correlations that the FRF does not contain are taken as zero. `frf` must outlive it.
  explicit NoiseCorrelation(const FrfEstimate& frf);

  bool known() const noexcept { return frf_ != nullptr && frf_->residual_covariance.size() > 0; }
  bool between_inputs() const noexcept {
    return known() && frf_->input_factor.size() > 0 && frf_->n_inputs() > 1;
  }

  /// R of one line for columns of split numbers, [re -im; im re], 2 n_y x 2 n_y. @pre known()
  Eigen::MatrixXd of_outputs(Eigen::Index line) const;
  /// S of one line, n_u x n_u. @pre between_inputs()
  Eigen::MatrixXcd of_inputs(Eigen::Index line) const;
  /// (S kron R)(c, d) of two channels on some lines, lines x 1; empty: zero. @pre known()
  SplitMatrix of_channels(Eigen::Index c, Eigen::Index d, DataRange lines) const;

 private:
  std::complex<double> R(Eigen::Index y, Eigen::Index z, Eigen::Index line) const;
  std::complex<double> S(Eigen::Index u, Eigen::Index v, Eigen::Index line) const;

  const FrfEstimate* frf_ = nullptr;
  Eigen::MatrixXd of_deviation_y_;  ///< 1 / sqrt(C(y, y)), 0 if it is unknown, outputs x lines
  Eigen::MatrixXd of_deviation_u_;  ///< the same of the inputs
};

/// The noise of the data, as far as known.
struct DataNoise {
  VarianceKnowledge knowledge = VarianceKnowledge::none;
  std::optional<LineVariance> variance;  ///< none: 1/W, up to a scale with `none`
  NoiseCorrelation correlation;          ///< of channels on a line
};

/// The noise of the data under diagonal weights. A given variance is not smoothed: the covariance is linear in it, and
/// smoothing would only lower its peaks. The total variance is used if there is one, because nonlinear distortion
/// changes an estimate from realization to realization as noise does. `frf` must outlive the result.
DataNoise data_noise(const FrfEstimate& frf, Weighting weighting);

/// Factor of the variances: 1 if the variance is given separately from the weights, or if the weights are inverse
/// variances and the residual is not clearly larger than predicted, else the residual per degree of freedom.
double covariance_scale(const FitProblem& problem, double cost, Eigen::Index parameters,
                        VarianceKnowledge knowledge);

/// The problem whose Gauss-Newton matrix is K for uncorrelated noise, with weights W C W.
/// @pre noise.variance is known
FitProblem middle_problem(const FitProblem& problem, const DataNoise& noise);

/// Columns of one channel on some lines, times W C^1/2; for correlated_gram().
SplitMatrix noise_scaled(const FitProblem& problem, const DataNoise& noise, Eigen::Index c,
                         DataRange lines, SplitMatrix columns);

/// Columns X = C_diag^1/2 W J of channels, as required by correlated_gram().
struct CorrelatedColumns {
  /// Per input: the parameters of its columns, in order.
  std::vector<std::vector<Eigen::Index>> parameters;
  /// Columns of an output (0-based) of an input, lines x parameters[u].
  std::function<SplitMatrix(Eigen::Index u, Eigen::Index output, DataRange lines)> columns;
  /// Called with (S kron R) X of an input, tile by tile in the order of the lines, inputs in parallel; may be empty.
  /// Its columns belong to parameters[u], or to all parameters if inputs are correlated.
  std::function<void(Eigen::Index u, DataRange lines, const OutputColumns& Z)> use = {};
};

/// J^H W C W J = sum_k Re{X^H (S kron R) X}, n x n parameters, in tiles of lines.
/// @pre all inputs are included if they are correlated
Eigen::MatrixXd correlated_gram(const FitProblem& problem, const NoiseCorrelation& correlation,
                                Eigen::Index n, const CorrelatedColumns& inputs);

}  // namespace stageid
