#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <vector>

#include "excitation/words/words.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// The matrix whose singular values are computed.
enum class CmifKind : std::uint8_t {
  response,     ///< G
  accelerance,  ///< omega^2 G: without the slope of the rigid body
  whitened      ///< every channel over its standard deviation, noise (else total); floor 1
};
template <>
inline constexpr std::array kWords<CmifKind> = {"response", "accelerance", "whitened"};

/// Complex mode indicator function: squared singular values of G(j omega_k), min(n_y, n_u) x N,
/// largest first. Source: paper, section 4.5; Shih et al. (1988).
/// @throws std::invalid_argument if `whitened` is requested for an FRF without variances.
Eigen::MatrixXd cmif(const FrfEstimate& frf, CmifKind kind = CmifKind::response);

/// Standard deviations of the CMIF curves, min(n_y, n_u) x N as cmif() gives them, to first order:
///   d(s^2) = 2 s Re(u^H dG v),   Var(s^2) = 2 s^2 sum_ab |u_a|^2 |v_b|^2 E|dG_ab|^2
/// with the singular value s and vectors u, v of the matrix selected by `kind`, for circular complex errors that
/// are uncorrelated between elements. `variance`, (n_y n_u) x N, is E|dG|^2 of the response.
/// Too small where two curves meet, or where one is below the noise (first order does not hold there).
/// Source: first-order perturbation of a simple singular value.
/// @throws std::invalid_argument if `variance` has another shape than the response, and as cmif().
Eigen::MatrixXd cmif_deviation(const FrfEstimate& frf, CmifKind kind,
                               const Eigen::MatrixXd& variance);

/// A candidate mode, as in modes.json.
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

/// Peaks of the CMIF curves that are modes: prominent, not the crossing of two curves. Damping from the half-power
/// width. Sorted by frequency; a line at 0 Hz is ignored.
std::vector<ModeCandidate> pick_modes(const FrfEstimate& frf, const PeakOptions& options = {});

/// modes.json as in docs/formats.md. @throws FileError, FormatError
void write_modes(const std::filesystem::path& file, const std::vector<ModeCandidate>& modes);
std::vector<ModeCandidate> read_modes(const std::filesystem::path& file);

}  // namespace stageid
