#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "frf/periods/realization_change.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/nonlinearity.hpp"
#include "frf/runs/realization_spectra.hpp"

namespace stageid {

/// Accumulates the LineAlignment of residuals and of responses over realizations. Spectra contain the excited lines
/// first, then the detection lines.
class AlignmentAverage {
 public:
  /// `excited`, `detection`: ascending.
  AlignmentAverage(std::vector<int> excited, const std::vector<int>& detection,
                   Eigen::Index outputs);

  /// `G_before`: (n_y n_u) x excited lines, the mean of the previous realizations, which does not contain the noise
  /// of this one; used from the second realization on. `G`: includes this realization.
  void add(const RealizationSpectra& spectra, const Eigen::MatrixXcd& G_before,
           const Eigen::MatrixXcd& G, int workers);

  /// `resolution_hz`: distance of neighbouring lines.
  LineAlignment of_residuals(double resolution_hz) const;
  /// LineAlignment::cosine of the responses; empty until the second realization.
  const Eigen::MatrixXd& cosine_of_responses() const noexcept { return responses_.cosine; }

 private:
  std::vector<int> excited_;
  std::vector<int> lines_;            // of both, ascending
  std::vector<Eigen::Index> column_;  // index into the spectra for each of lines_
  Eigen::Index outputs_;
  bool first_ = true;
  LineAlignment residuals_;
  LineAlignment responses_;
};

/// A change of the plant between the realizations, whose differences from the previous ones turn by `cosine`: in an
/// octave or in the whole band, they turn less from line to line than chance explains, in one entry of G or in all of
/// one output together. A mode, a mass or a gain that changes does so on all lines near it; a distortion has another
/// phase on every line. If one experiment of n with all axes changed, a share 1 / n of the difference is smooth.
/// With s_k the sum of cosines on line k, whose sign is random if the plant did not change, each weighted by the part of
/// the realizations' scatter that is not noise,
///   P(sum s_k / sqrt(sum s_k^2) > t) <= exp(-t^2 / 2),
/// however the entries depend on each other. A change needs kSignificance over all these tests.
/// @param frf finished, on the same lines; `cosine`: AlignmentAverage::cosine_of_responses()
/// Source: self-normalized sums of symmetric variables (de la Pena, Lai and Shao, Self-Normalized Processes, 2009).
std::optional<PlantChange> find_plant_change(const FrfEstimate& frf, const Eigen::MatrixXd& cosine);

}  // namespace stageid
