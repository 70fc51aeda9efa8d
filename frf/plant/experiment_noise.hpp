#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/response/line_estimate.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// The noise of Y - G U of one realization, by block of lines.
struct NoiseLevels {
  int realization = 0;
  std::vector<Eigen::MatrixXd> log_power;  ///< mean over the lines, outputs x experiments
  std::vector<Eigen::MatrixXd> weight;     ///< one over its variance; zero: unknown
  Eigen::Array<bool, -1, -1> differs;      ///< outputs x blocks: between experiments
};

/// The noise of Y - G U in each experiment of one realization, and a test whether it is the same in all.
///
/// In the loop this is the open-loop noise, for any excitation, so the experiments are expected to agree and are
/// pooled. A compressor that runs during one of them, or a sensor that warms up, makes them differ.
///
/// Let s_e,i(k) be the variance of output i on line k in experiment e, with nu_e complex degrees of freedom. Then
/// ln s has the mean ln sigma^2 + psi(nu_e) - ln nu_e and the variance psi'(nu_e), for any sigma. Its means over
/// blocks of 64 lines or more are compared by a chi-square test, with a probability of one in a million over all
/// blocks and outputs. They must also differ by a factor of 1.3; below it, the degrees of freedom gained by
/// pooling are worth more. Noise below 1e-5 of the output is ignored: it is rounding, or the remainder of a
/// modelled transient. A block is either pooled or not as a whole.
///
/// Slow noise leaks into all lines of a period at once, so lines may depend on each other. The variance of a mean is
/// multiplied by the factor that the periods show (RunSpectra::common_sum over own_sum, at least 1). The mean power
/// then has few degrees of freedom, a = 1 / variance, and its logarithm is not normal. Therefore the ratio of the
/// largest and the smallest must also have that probability under F(2a, 2a), over all pairs.
class ExperimentNoise {
 public:
  /// @param lines      of the realization, all LineStatus::good
  /// @param shared     lines per independent one: those of a local model's window, otherwise 1
  ExperimentNoise(const RealizationSpectra& spectra, const std::vector<LineEstimate>& lines,
                  double shared, int workers);

  bool differs(Eigen::Index k) const { return !blocks_differ_.empty() && blocks_differ_[at(k)]; }
  /// Largest ratio of the noise powers of two experiments, over outputs and blocks; 1 if they agree.
  double ratio() const noexcept { return ratio_; }
  /// Mean logarithms of the power; empty if unknown.
  const NoiseLevels& levels() const noexcept { return levels_; }
  /// Power of each output's noise in the block of line k, mean over the experiments; ones if unknown.
  Eigen::VectorXd level(Eigen::Index k) const;

  /// C_Ee of one period on line k, one entry per experiment.
  std::vector<Eigen::MatrixXcd> covariances(const LineEstimate& line, Eigen::Index k) const;

  /// Approximates the experiments' covariances by one C_E. Experiment e has the share g_ei of the power of output i,
  /// with mean 1 over the experiments. C_E is pooled after the shares have been divided out.
  ///   input_part = sum_e g_e q_e q_e^H / P_e, gain_ij = sum_e g_ei |q_ej|^2 / P_e.
  LineNoise scaled(const LineEstimate& line, const Eigen::VectorXd& periods, Eigen::Index k) const;

 private:
  Eigen::Index at(Eigen::Index k) const;  ///< the block of line k
  double compare(Eigen::Index block);

  const RealizationSpectra& spectra_;
  Eigen::Index lines_;
  Eigen::Index outputs_ = 0;
  NoiseLevels levels_;
  std::vector<Eigen::MatrixXd> share_;  // per block: outputs x experiments
  std::vector<bool> blocks_differ_;
  double ratio_ = 1.0;
};

/// A run whose noise differs from that of the others.
struct OddRun {
  int realization = 0;  ///< counted from 0
  Eigen::Index experiment = 0;
  Eigen::Index output = 0;  ///< with the largest difference
  double ratio = 1.0;       ///< to the median of all runs
};

/// The runs that explain why experiments differ: those 1.3 times and 5 standard deviations from the median of all runs,
/// in outputs and blocks with a difference. At least one, that with the largest deviation. Of two runs, the noisier.
std::vector<OddRun> odd_runs(const std::vector<NoiseLevels>& realizations);

}  // namespace stageid
