#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/response/line_estimate.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

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
class ExperimentNoise {
 public:
  /// @param lines      of the realization, all LineStatus::good
  /// @param shared     lines per independent one: those of a local model's window, otherwise 1
  ExperimentNoise(const RealizationSpectra& spectra, const std::vector<LineEstimate>& lines,
                  double shared, int workers);

  bool differs(Eigen::Index k) const { return !blocks_differ_.empty() && blocks_differ_[at(k)]; }
  /// Largest ratio of the noise powers of two experiments, over outputs and blocks; 1 if they agree.
  double ratio() const noexcept { return ratio_; }
  /// An experiment whose noise differs from the median by a factor of 1.3 and 5 standard deviations. If any differ,
  /// at least the one with the largest deviation.
  struct Odd {
    Eigen::Index experiment = 0;
    Eigen::Index output = 0;  ///< with the largest difference
    double ratio = 1.0;       ///< to the median
  };
  const std::vector<Odd>& odd() const noexcept { return odd_; }

  /// C_Ee of one period on line k, one entry per experiment.
  std::vector<Eigen::MatrixXcd> covariances(const LineEstimate& line, Eigen::Index k) const;

  /// Approximates the experiments' covariances by one C_E. Experiment e has the share g_ei of the power of output i,
  /// with mean 1 over the experiments. C_E is pooled after the shares have been divided out.
  ///   input_part = sum_e g_e q_e q_e^H / P_e, gain_ij = sum_e g_ei |q_ej|^2 / P_e.
  LineNoise scaled(const LineEstimate& line, const Eigen::VectorXd& periods, Eigen::Index k) const;

 private:
  std::size_t at(Eigen::Index k) const;  ///< the block of line k
  double compare(const Eigen::MatrixXd& mean, const Eigen::VectorXd& weight);
  void note(const Eigen::VectorXd& log_power, const Eigen::VectorXd& weight, Eigen::Index output);

  const RealizationSpectra& spectra_;
  Eigen::Index lines_;
  Eigen::Index blocks_ = 1;
  std::vector<Eigen::MatrixXd> share_;  // per block: outputs x experiments
  std::vector<bool> blocks_differ_;
  double ratio_ = 1.0;
  std::vector<Odd> odd_;
};

}  // namespace stageid
