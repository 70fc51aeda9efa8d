#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/response/line_estimate.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// The noise of Y - G U in each experiment of one realization, and whether it is the same in all.
///
/// In the loop it is the open-loop noise, whatever was excited, so that the experiments are expected to agree and
/// are pooled; but a compressor that runs during one of them, or a sensor that warms up, makes them differ.
/// With s_e,i(k) the variance of output i on line k in experiment e, of nu_e complex degrees of freedom,
/// ln s has the mean ln sigma^2 + psi(nu_e) - ln nu_e and the variance psi'(nu_e), whatever sigma is. Means of it over
/// blocks of lines, 64 or more, are compared by a chi-square test with one in a million by chance over all
/// blocks and outputs; and they must be apart by more than the factor 1.3, below which the degrees of freedom that
/// pooling has are worth more. What is less than 1e-5 of the output is rounding, or a transient that a model
/// left. A block is pooled or not as a whole.
class ExperimentNoise {
 public:
  /// @param lines      of the realization, all LineStatus::good
  /// @param shared     lines that tell as much as one: those of a local model's window, else 1
  ExperimentNoise(const RealizationSpectra& spectra, const std::vector<LineEstimate>& lines,
                  double shared, int workers);

  bool differs(Eigen::Index k) const { return !blocks_differ_.empty() && blocks_differ_[at(k)]; }
  /// Largest over smallest noise power of two experiments, of the output and block where that is most; 1
  /// where none differs.
  double ratio() const noexcept { return ratio_; }
  /// An experiment whose noise is a factor 1.3 and 5 deviations off the median where they differ; at least the one
  /// that is most off, if any differs.
  struct Odd {
    Eigen::Index experiment = 0;
    Eigen::Index output = 0;  ///< where it differs most
    double ratio = 1.0;       ///< to the median
  };
  const std::vector<Odd>& odd() const noexcept { return odd_; }

  /// C_Ee of one period on line k, an entry an experiment.
  std::vector<Eigen::MatrixXcd> covariances(const LineEstimate& line, Eigen::Index k) const;

  /// What comes nearest to one C_E of all experiments: experiment e has the share g_ei of the power of
  /// output i, mean 1 over the experiments, and C_E is pooled from what is left with the shares taken out.
  ///   input_part = sum_e g_e q_e q_e^H / P_e, gain_ij = sum_e g_ei |q_ej|^2 / P_e.
  LineNoise scaled(const LineEstimate& line, const Eigen::VectorXd& periods, Eigen::Index k) const;

 private:
  std::size_t at(Eigen::Index k) const;  ///< the block of line k
  double compare(const Eigen::MatrixXd& mean, const Eigen::VectorXd& weight);
  void note(const Eigen::VectorXd& log_power, const Eigen::VectorXd& weight, Eigen::Index output);

  const RealizationSpectra& spectra_;
  Eigen::Index lines_;
  Eigen::Index blocks_ = 1;
  std::vector<Eigen::MatrixXd> share_;  // a block: outputs x experiments
  std::vector<bool> blocks_differ_;
  double ratio_ = 1.0;
  std::vector<Odd> odd_;
};

}  // namespace stageid
