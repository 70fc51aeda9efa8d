#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace stageid {

struct FrfEstimate;

/// Outputs on lines that were not excited, without the linear response to the controller's feedback there:
/// E = Y - G U, G interpolated between the excited lines. On a linear plant E is noise, in closed loop too.
///
/// Runs are grouped by their excitation: one group per axis if every run excites one axis, otherwise one group of
/// all.
struct DetectionLines {
  Eigen::VectorXd frequency_hz;     ///< D, within 4 lines of an excited one; empty if unknown
  Eigen::VectorXi line;             ///< D: index of the DFT of one period; odd or even
  std::vector<std::string> groups;  ///< n_g: the excited channel of each, or "all"
  Eigen::VectorXd runs;             ///< n_g: complex degrees of freedom of `power`
  Eigen::MatrixXd power;            ///< (n_y n_g) x D: |E|^2 of the means of periods, over the runs
  Eigen::MatrixXd noise;            ///< n_y x D: the part of it due to noise, from the periods
  double noise_dof = 0.0;
  Eigen::MatrixXd linear_power;  ///< (n_y n_g) x N: |Y|^2 on the excited lines
};

/// The variances of nonlinearity_test() for a mean with each realization weighted by its own noise. They keep the F
/// distribution even if the noise of one realization is a hundred times that of another (level, phases,
/// controller).
struct RealizationScatter {
  Eigen::MatrixXd total;  ///< (n_y n_u) x N, from the scatter of the realizations; empty if unknown
  Eigen::MatrixXd noise;  ///< (n_y n_u) x N, from the periods
  double noise_dof = 0.0;  ///< of `noise`
};

/// Phase steps of some spectra from one line to the next. For noise and stochastic nonlinear contributions the angle is
/// random.
/// Of the residual E = Y - G U, on detection lines and, from the second realization on, on excited lines with the G of
/// the previous realizations: a transient or a drift, which a record has at one end only, is smooth over the lines.
/// Of the difference of a realization's G from the previous ones, on excited lines: that of a changed plant is smooth.
struct LineAlignment {
  Eigen::VectorXd frequency_hz;  ///< L; empty if unknown
  /// rows x L: of the angle from the previous line, summed over the spectra
  Eigen::MatrixXd cosine;
  Eigen::MatrixXd pairs;  ///< rows x L: number of summed angles

  /// Adds rows x L; values whose power is not above `smallest` of their row are rounding errors.
  void add(const Eigen::MatrixXcd& values, const Eigen::VectorXd& smallest);
};

/// Evidence about linearity in addition to the estimate and its variances.
struct LinearityEvidence {
  RealizationScatter scatter;
  LineAlignment alignment;
};

/// Distortions of one kind on detection lines: even-order ones on even lines, odd-order ones on odd lines. Rows are
/// output + n_y * group.
struct DetectedDistortion {
  Eigen::MatrixXd p_value;  ///< x bands: probability of this power on a linear plant; 1: no line
  Eigen::MatrixXd level;    ///< x bands: rms of a line's distortion over that of an excited line
};

/// Tests of linearity for each output, input and band.
struct NonlinearityTest {
  Eigen::MatrixXd band_hz;     ///< bands x 2: first and last frequency, both in the band; or empty
  Eigen::MatrixXd p_value;     ///< (n_y n_u) x bands: probability of this scatter on a linear plant
  Eigen::MatrixXd distortion;  ///< (n_y n_u) x bands, relative to |G|: see nonlinearity_test()
  DetectedDistortion even;     ///< empty without detection lines
  DetectedDistortion odd;
  /// bands: probability of lines this similar in settled records; empty: unknown. Below kUnsettledBelow, linearity
  /// cannot be tested in this band, and all its p-values are 1.
  Eigen::VectorXd settled_p_value;

  /// Whether linearity can be tested in band b.
  bool settled(Eigen::Index b) const;
  /// The smallest p-value of all outputs, inputs, bands and detection lines; 1 without a test.
  double least_p_value() const;
  /// Whether the plant is nonlinear: least_p_value() is below kNonlinearBelow over the number of tests (Bonferroni), so
  /// that one of a hundred linear plants is called nonlinear.
  bool nonlinear() const;
};

/// Largest p-value of a nonlinear verdict: false in one of a hundred cases.
inline constexpr double kNonlinearBelow = 0.01;
/// Largest settled_p_value of an unsettled band: false in one of a hundred cases.
inline constexpr double kUnsettledBelow = 0.01;

/// Tests for stochastic nonlinear contributions in the presence of noise (docs/theory.md, section 3).
///
/// On a linear plant, F = total_variance / noise_variance has the distribution F(2 (M - 1), 2 nu) on every line,
/// nu = noise_dof. Its upper tail p_k is therefore uniform for any colour of the noise. Lines are independent, so
/// over the K lines of a band (Fisher)
///   -2 sum_k ln p_k  is chi-square with 2 K degrees of freedom.
/// p_value is its upper tail; p_value < 0.01 is a false alarm in one of a hundred tests. Bands are
/// octaves from the first line on, joined until each has at least 8 lines.
///   distortion^2 = sum_k max(0, M (total - noise)) / sum_k |G|^2,
/// the power of the stochastic nonlinear contributions of one realization.
///
/// On detection lines, F = power / noise is F(2 runs, 2 nu) in the same way, for each output and group and any
/// interpolated G. An error of G only affects the level, by its relative error times the loop's T.
/// level^2 = mean_k max(0, power - noise) / mean linear_power over the band.
///
/// Both assume independent lines, and that all excess of a run is distortion. Neither is true for records with a
/// transient or a drift. There, the cosine of the angle between neighbouring lines of E does not have the mean 0,
/// so over the n pairs of a band
///   z = sum cos / sqrt(n / 2)
/// is not standard normal. settled_p_value is the smallest upper tail of z over the outputs, of the band and of all
/// bands together, times the number of these tests.
/// `evidence`: from the records, if available; otherwise the variances of the estimate are used.
/// Source: Pintelon and Schoukens, System Identification (2012), sections 4.3 and 7.3; Mardia and Jupp,
/// Directional Statistics (2000), section 6.3 (tests of uniformity).
/// @throws std::invalid_argument with the text of why_linearity_cannot_be_tested().
NonlinearityTest nonlinearity_test(const FrfEstimate& frf, const LinearityEvidence& evidence = {});

/// The test stored in the estimate, otherwise that of its variances; without bands if linearity cannot be tested.
NonlinearityTest linearity_of(const FrfEstimate& frf);

/// Empty, or the missing requirement: two periods, two realizations with total_dof = M - 1, the periodic method (with
/// lpm, neighbouring lines share bins), noise that was not smoothed over lines (they would not be
/// independent).
std::string why_linearity_cannot_be_tested(const FrfEstimate& frf);

}  // namespace stageid
