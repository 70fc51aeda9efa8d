#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "frf/response/line_estimate.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// Number of lines per axis for the local model. It leaves at least six degrees of freedom for all
/// axes together, and two per axis.
int zippered_window(int axes);

/// Whether the log's experiments excite several axes at once, each on its own lines, so that one experiment is a
/// whole realization.
/// @throws the same as LogReader::excitation()
bool is_zippered(const LogReader& log);

/// The axis of each line of a zippered experiment.
struct ZipperedLines {
  std::vector<int> lines;          ///< ascending
  std::vector<Eigen::Index> axis;  ///< of each line, 0 .. axes - 1
  Eigen::Index axes = 0;

  /// Indices of the lines of one axis, ascending.
  std::vector<Eigen::Index> of(Eigen::Index axis) const;
  /// Range of indices in which every axis has a line at or below, and one at or above.
  Eigen::Index first() const;
  Eigen::Index last() const;
};

/// @param names  of the axes, for the message; `place` names the run
/// @throws std::invalid_argument if an axis has fewer than zippered_window() lines.
void require_enough_lines(const ZipperedLines& lines, const std::vector<std::string>& names,
                          const std::string& place);

/// One realization of a zippered experiment on one line.
struct ZipperedEstimate {
  LineEstimate line;
  LineNoise noise;
  double noise_dof = 0.0;  ///< of noise.residual
  /// Variance of an entry of Z R^-1 over that on an excited line: mean over the axes. Below 1, because the local model
  /// averages.
  double variance_share = 0.0;
  /// Residual of the local model over the expected noise, mean over the outputs; 0: unknown.
  double misfit = 0.0;
};

/// Responses to every axis on every line, from one experiment in which each axis has its own lines.
///
/// On a line k of axis p, the loop gives Z(k) = H_p(k) R_p(k) + V(k), one column H_p of Z R^-1. All columns are
/// modelled around line l, on the zippered_window() nearest lines of each axis,
///   Z(k) = R_p(k) (theta_p0 + theta_p1 r + theta_p2 r^2 + theta_p3 r^3) / D(r) + V(k),
/// r = (k - l) / reach. D has up to three poles and is common to all axes (average_locally() averages over their
/// number). G = Y U^-1 of [theta_10 theta_20 ...]. Each column is a weighted sum of spectra on other lines, so
///   Cov(vec G) = sum_p |w_p|^2 (q_p q_p^H) kron C_E / P + (uncertainty of D),
/// q_p row p of U^-1. C_E is the weighted mean of the lines' covariances, pooled with the residual of the local
/// model. If that residual exceeds noise with a probability below 1 %, C_E is raised to it, because it contains
/// modelling errors. With one period C_E is the residual alone.
/// Source: Pintelon and Schoukens, System Identification (2012), sections 2.7.2 and 7.2.
class ZipperedFit {
 public:
  static constexpr int kRegressors = 4;

  /// `outputs`: number of channels Y of Z, and rank of its noise.
  /// @pre require_enough_lines()
  ZipperedFit(ZipperedLines lines, Eigen::Index outputs);

  const ZipperedLines& lines() const noexcept { return lines_; }

  /// `spectra`: of one experiment. k: index of the line.
  ZipperedEstimate estimate(const RealizationSpectra& spectra, Eigen::Index k) const;

 private:
  std::vector<Eigen::Index> window(Eigen::Index k) const;
  int line(Eigen::Index k) const { return lines_.lines[k]; }

  ZipperedLines lines_;
  std::vector<std::vector<Eigen::Index>> of_axis_;
  Eigen::Index outputs_;
  Eigen::Index bins_;  ///< of each axis
};

}  // namespace stageid
