#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// What stands inside the singular values.
enum class CmifKind : std::uint8_t {
  response,     ///< G
  accelerance,  ///< omega^2 G: no rigid-body slope
  whitened      ///< every channel over its standard deviation, noise (else total); the floor is 1
};

/// Complex mode indicator function: squared singular values of G(j omega_k), min(n_y, n_u) x N,
/// largest first. Source: paper, section 4.5; Shih et al. (1988).
/// @throws std::invalid_argument if `whitened` is asked of an FRF without variances.
Eigen::MatrixXd cmif(const FrfEstimate& frf, CmifKind kind = CmifKind::response);

/// A candidate mode, as modes.json holds it.
struct ModeCandidate {
  double frequency_hz = 0.0;
  double damping_ratio = 0.01;
  int cmif_curve = 1;  ///< 1-based
};

struct PeakOptions {
  CmifKind kind = CmifKind::accelerance;
  double minimum_prominence_db = 3.0;
  int most_peaks = 100;
};

/// Peaks of the CMIF curves that are modes: prominent, not the crossing of two curves, damping from
/// the half-power width. By frequency. A line at 0 Hz is left out.
std::vector<ModeCandidate> pick_modes(const FrfEstimate& frf, const PeakOptions& options = {});

/// modes.json as in docs/formats.md. @throws FileError, FormatError
void write_modes(const std::filesystem::path& file, const std::vector<ModeCandidate>& modes);
std::vector<ModeCandidate> read_modes(const std::filesystem::path& file);

}  // namespace stageid
