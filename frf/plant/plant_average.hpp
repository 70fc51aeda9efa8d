#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "frf/plant/experiment_noise.hpp"
#include "frf/plant/realization_comparison.hpp"
#include "frf/plant/realization_scatter.hpp"
#include "frf/plant/response_drift.hpp"
#include "frf/plant/zippered_fit.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/frf_options.hpp"
#include "frf/response/line_estimate.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// Mean over realizations, G = (mean_m Y_m)(mean_m U_m)^-1, Z_m = Z R^+,
/// and the uncertainty of that mean.
///   noise: C_n = sum_m C_n^[m] / M^2, each realization with its own U and G (bounded memory);
///   total: sum_m |G^[m] - mean G|^2 / (M (M - 1)).
/// With one common C_E, C_n is S kron C_E with S = sum_m A_m / (M^2 mean 1/P_e), and C_E, of the mean of periods,
/// is the mean over the realizations.
///
/// Experiments of one realization whose noise differs (ExperimentNoise) are not pooled. Then
/// C_n^[m] = sum_e q_e q_e^H / P_e kron C_Ee with the degrees of freedom of Welch and Satterthwaite, and S and
/// C_E are approximations.
class PlantAverage {
 public:
  PlantAverage(Eigen::VectorXd frequency_hz, std::vector<int> lines, Eigen::Index outputs,
               Eigen::Index inputs, CovarianceKind covariance);

  /// Lines are distributed over `workers` threads. `zippered`: the model between the lines of each axis, if not all
  /// axes are excited on all lines; the same in all calls.
  /// @throws std::invalid_argument "singular ..." naming realization, line and frequency.
  void add(const RealizationSpectra& spectra, int workers, const ZipperedFit* zippered = nullptr);

  /// Mean of the realizations' own estimates so far, vec(G) x lines.
  const Eigen::MatrixXcd& mean_response() const noexcept { return G_mean_; }

  /// Writes frequencies, response, variances, degrees of freedom, condition and covariances.
  /// @throws std::invalid_argument if a full covariance is requested but the noise is unknown.
  void finish(FrfEstimate& frf, int workers) const;

  /// Input of nonlinearity_test(); empty if more realizations, periods or independent lines are needed.
  RealizationScatter scatter() const;

  /// Drift of the response. @param frf result of finish(); `run_periods`: periods per run
  std::optional<ModeDrift> drift(const FrfEstimate& frf, int run_periods) const;
  /// Differences between the realizations' responses. @param frf as for drift()
  RealizationDifferences differences(const FrfEstimate& frf) const { return comparison_.find(frf); }
  /// Runs whose noise differs from that of the others.
  std::vector<OddRun> odd_runs() const { return stageid::odd_runs(noise_levels_); }

 private:
  void add_noise(const RealizationSpectra& spectra, const LineEstimate& line,
                 const ExperimentNoise& experiments, const Eigen::VectorXd& periods,
                 Eigen::Index k);
  void add_zippered(const RealizationSpectra& spectra, const ZipperedFit& fit, Eigen::Index k);
  void add_response(const RealizationSpectra& spectra, const LineEstimate& line, Eigen::Index k);
  void finish_zippered(FrfEstimate& frf) const;
  void add_common(const LineNoise& noise, Eigen::Index k);
  void add_product(const Eigen::MatrixXcd& A, const Eigen::MatrixXcd& C, double dof,
                   Eigen::Index k);
  double effective_dof() const;
  void finish_line(FrfEstimate& frf, Eigen::Index k) const;
  bool noise_known() const noexcept { return realizations_ > 0 && noise_known_; }

  Eigen::VectorXd frequency_hz_;
  std::vector<int> lines_;
  Eigen::Index outputs_;
  Eigen::Index inputs_;
  CovarianceKind covariance_kind_;

  int realizations_ = 0;
  bool noise_known_ = true;
  Eigen::MatrixXcd Z_sum_;      // vec(Z_m) x lines
  Eigen::MatrixXcd G_mean_;     // vec(G) x lines, of the realizations' own estimates
  Eigen::MatrixXd G_scatter_;   // sum |G^[m] - mean|^2
  Eigen::MatrixXd noise_sum_;   // sum of the realizations' noise variances
  Eigen::MatrixXd scarce_sum_;  // sum of a^2 / (nu + 1) over their terms a
  double experiment_noise_ratio_ = 1.0;
  Eigen::MatrixXcd residual_sum_;    // vec(C_E) of the mean of periods
  Eigen::MatrixXcd input_sum_;       // vec(A_m) over the mean of 1 / P_e
  Eigen::MatrixXcd covariance_sum_;  // vec(Cov(vec G)), on request
  Eigen::VectorXd condition_;
  ScatterAverage scatter_;
  ResponseDrift drift_;
  RealizationComparison comparison_;
  std::vector<NoiseLevels> noise_levels_;  // by realization
  Eigen::Index zippered_axes_ = 0;
  Eigen::VectorXd dof_sum_;       // sum of the noise's degrees of freedom
  Eigen::VectorXd scarcity_sum_;  // zippered: sum of 1 / degrees of freedom
  Eigen::VectorXd share_sum_;     // sum of the variance shares
  Eigen::VectorXd misfit_sum_;
};

}  // namespace stageid
