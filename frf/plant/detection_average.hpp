#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "frf/response/nonlinearity.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// Unexcited lines between the first and the last of `excited` (ascending) that are at most four lines from an
/// excited one. The response cannot be interpolated further away, and a sparse grid would have thousands.
std::vector<int> detection_lines(const std::vector<int>& excited);

/// vec(G) on `line`, interpolated linearly between the two neighbouring lines of `excited`; `G`: one column per line.
/// @pre excited.front() < line < excited.back()
Eigen::VectorXcd interpolated_response(const std::vector<int>& excited, int line,
                                       const Eigen::MatrixXcd& G);

/// Accumulates DetectionLines over realizations. Spectra contain the excited lines first, then the detection
/// lines.
class DetectionAverage {
 public:
  /// `lines`: excited ones; `axes`: names of the excited channels; `single_axis`: every run excites only one of
  /// them.
  DetectionAverage(const std::vector<int>& lines, const std::vector<std::string>& axes,
                   bool single_axis, Eigen::Index outputs);

  /// `G`: (n_y n_u) x excited lines, the current estimate of the response; `axis`: of each experiment, its first
  /// excited one as an index into the list of axes. Does nothing if the noise is unknown.
  void add(const RealizationSpectra& spectra, const Eigen::MatrixXcd& G,
           const std::vector<Eigen::Index>& axis, int workers);

  /// `resolution_hz`: distance of neighbouring lines. Empty if nothing was added.
  DetectionLines finish(double resolution_hz) const;

 private:
  void add_line(const RealizationSpectra& spectra, const Eigen::MatrixXcd& G,
                const std::vector<Eigen::Index>& groups, Eigen::Index d);

  std::vector<int> excited_;
  std::vector<int> detection_;
  Eigen::Index outputs_;
  bool noise_known_ = true;
  double periods_ = 0.0;  // of all runs
  // `power`: sum of P |E|^2, whose expectation under noise is that of one period; `noise`: sum of |E_p - E|^2.
  DetectionLines sum_;
};

}  // namespace stageid
