#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace stageid {

struct FrfEstimate;

/// What the outputs do on lines that were not excited, after the linear response to what the
/// controller feeds back there has been taken out: E = Y - G U, G interpolated between the excited
/// lines. On a linear plant that is noise alone, in closed loop too.
///
/// Runs are gathered by what they excite: one group for each axis if every run excites one axis,
/// else one group of all.
struct DetectionLines {
  Eigen::VectorXd frequency_hz;     ///< D, within 4 lines of an excited one; empty if unknown
  Eigen::VectorXi line;             ///< D: of the DFT of one period; odd or even
  std::vector<std::string> groups;  ///< n_g: the excited channel of each, or "all"
  Eigen::VectorXd runs;             ///< n_g: power has so many complex degrees of freedom
  Eigen::MatrixXd power;            ///< (n_y n_g) x D: |E|^2 of the means of periods, over the runs
  Eigen::MatrixXd noise;            ///< n_y x D: how much of it noise is, from the periods
  double noise_dof = 0.0;
  Eigen::MatrixXd linear_power;  ///< (n_y n_g) x N: |Y|^2 on the excited lines
};

/// The variances of nonlinearity_test() for the mean that counts each realization by its own noise: of
/// one whose noise is a hundred times another's (level, phases, controller) they keep F's distribution.
struct RealizationScatter {
  Eigen::MatrixXd total;  ///< (n_y n_u) x N, from the scatter of the realizations; empty if unknown
  Eigen::MatrixXd noise;  ///< (n_y n_u) x N, from the periods
  double noise_dof = 0.0;  ///< of `noise`
};

/// Whether what a run leaves, E = Y - G U, turns from one line to the next. Noise and stochastic
/// nonlinear contributions do, by a random angle; what a record has at one end and not at the other, a
/// transient or a drift, is smooth over the lines. E is taken on detection lines and, from the second
/// realization on, on excited lines with the G of the realizations before.
struct LineAlignment {
  Eigen::VectorXd frequency_hz;  ///< L: excited and detection lines; empty if unknown
  Eigen::MatrixXd cosine;  ///< n_y x L: of the angle from the line before, summed over the runs
  Eigen::MatrixXd pairs;   ///< n_y x L: how many that are
};

/// What the records tell of linearity beyond the estimate and its variances.
struct LinearityEvidence {
  RealizationScatter scatter;
  LineAlignment alignment;
};

/// Distortions of one kind, seen on detection lines: even-order ones on even lines, odd-order ones
/// on odd lines. Rows are output + n_y * group.
struct DetectedDistortion {
  Eigen::MatrixXd p_value;  ///< x bands: chance of so much power on a linear plant; 1: no line
  Eigen::MatrixXd level;    ///< x bands: rms of a line's distortion over that of an excited line
};

/// Is the plant linear, as far as can be told? One answer for each output, input and band.
struct NonlinearityTest {
  Eigen::MatrixXd band_hz;     ///< bands x 2: first and last frequency, both in the band; or empty
  Eigen::MatrixXd p_value;     ///< (n_y n_u) x bands: chance of so much scatter on a linear plant
  Eigen::MatrixXd distortion;  ///< (n_y n_u) x bands, relative to |G|: see nonlinearity_test()
  DetectedDistortion even;     ///< empty without detection lines
  DetectedDistortion odd;
  /// bands: chance of lines that are so much alike in settled records; empty: unknown. Below
  /// kUnsettledBelow linearity cannot be told in this band, and every p-value there is 1.
  Eigen::VectorXd settled_p_value;

  /// Whether linearity can be told in band b.
  bool settled(Eigen::Index b) const;
  /// The smallest p-value of all outputs, inputs, bands and detection lines; 1 without a test.
  double least_p_value() const;
  /// Whether the plant is nonlinear: least_p_value() is below kNonlinearBelow over the number of tests (Bonferroni), so
  /// that one of a hundred linear plants is called nonlinear.
  bool nonlinear() const;
};

/// A p-value below this is called nonlinear: one of a hundred verdicts on a linear plant.
inline constexpr double kNonlinearBelow = 0.01;
/// A settled_p_value below this is called not settled: one of a hundred bands of settled records.
inline constexpr double kUnsettledBelow = 0.01;

/// Noise against stochastic nonlinear contributions.
///
/// On a linear plant F = total_variance / noise_variance has on every line the distribution
/// F(2 (M - 1), 2 nu), nu = noise_dof. Its upper tail p_k is uniform then, whatever the noise's
/// colour, and lines are independent, so that over the K lines of a band (Fisher)
///   -2 sum_k ln p_k  is chi-square with 2 K degrees of freedom;
/// p_value is its upper tail: p_value < 0.01 is a false alarm in one of a hundred tests. Bands are
/// octaves from the first line on, joined until each has at least 8 lines.
///   distortion^2 = sum_k max(0, M (total - noise)) / sum_k |G|^2,
/// the power of the stochastic nonlinear contributions of one realization.
///
/// On detection lines F = power / noise is F(2 runs, 2 nu) in the same way, for each output and
/// group, whatever G was interpolated; a wrong G blurs the level only, by its relative error times
/// the loop's T. level^2 = mean_k max(0, power - noise) / mean linear_power over the band.
///
/// Both take lines for independent, and what a run has in excess of the others for distortion: neither
/// holds in records with a transient or a drift. There the cosine of the angle between neighbouring lines
/// of E has not the mean 0, so that over the n pairs of a band
///   z = sum cos / sqrt(n / 2)
/// is not standard normal. settled_p_value is the least upper tail of z over the outputs, of the band
/// and of all bands together, times the number of these tests.
/// `evidence`: of the records, if they are there; else the variances are those of the estimate.
/// Source: Pintelon and Schoukens, System Identification (2012), sections 4.3 and 7.3; Mardia and Jupp,
/// Directional Statistics (2000), section 6.3 (tests of uniformity).
/// @throws std::invalid_argument with the text of why_linearity_cannot_be_tested().
NonlinearityTest nonlinearity_test(const FrfEstimate& frf, const LinearityEvidence& evidence = {});

/// The test that the estimate holds, else that of its variances; without bands where linearity cannot be tested.
NonlinearityTest linearity_of(const FrfEstimate& frf);

/// Empty, or what is missing: two periods, two realizations with total_dof = M - 1, the periodic
/// method (with lpm neighbouring lines share bins), noise that was not smoothed over lines (they
/// would not be independent).
std::string why_linearity_cannot_be_tested(const FrfEstimate& frf);

}  // namespace stageid
