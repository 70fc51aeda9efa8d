#include "estimation/problem/weight_matrices.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "acquisition/files/fail.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

constexpr double kLargestBytes = 2147483648.0;  // of whole weight matrices
constexpr double kHermitian = 1e-9;       // relative; files may hold single precision products
constexpr double kSemidefinite = -1e-10;  // rounding of the smallest eigenvalue
constexpr double kSmallestPivot = 1e-12;  // of a correlation matrix

std::string line_name(const FrfEstimate& frf, Eigen::Index k) {
  return fmt::format("line {} ({} Hz)", k, frf.frequency_hz[k]);
}

bool is_hermitian(const Eigen::MatrixXcd& M) {
  return (M - M.adjoint()).cwiseAbs().maxCoeff() <= kHermitian * M.cwiseAbs().maxCoeff();
}

/// M^-1 of a Hermitian positive definite matrix, first scaled to unit diagonal because units differ; empty if M is not
/// positive definite.
Eigen::MatrixXcd definite_inverse(const Eigen::MatrixXcd& M) {
  const Eigen::VectorXd diagonal = M.diagonal().real();
  if (!(diagonal.minCoeff() > 0.0)) return {};
  const Eigen::VectorXd scale = diagonal.cwiseSqrt().cwiseInverse();
  const Eigen::LLT<Eigen::MatrixXcd> factor(
      Eigen::MatrixXcd(scale.asDiagonal() * M * scale.asDiagonal()));
  if (factor.info() != Eigen::Success ||
      !(factor.matrixLLT().diagonal().cwiseAbs2().minCoeff() > kSmallestPivot))
    return {};
  const Eigen::MatrixXcd unit = Eigen::MatrixXcd::Identity(M.rows(), M.cols());
  return scale.asDiagonal() * factor.solve(unit) * scale.asDiagonal();
}

Eigen::MatrixXcd inverse_or_refuse(const FrfEstimate& frf, const Eigen::MatrixXcd& M,
                                   Eigen::Index k, const char* name, const char* remedy) {
  Eigen::MatrixXcd inverse;
  if (is_hermitian(M)) inverse = definite_inverse(M);
  if (inverse.size() == 0)
    throw IndefiniteWeights(
        fmt::format("weighting likelihood: {} of {} is not Hermitian and positive definite; {}",
                    name, line_name(frf, k), remedy));
  return inverse;
}

void require_factors(const FrfEstimate& frf) {
  for (const auto& [size, name] : {std::pair{frf.residual_covariance.size(), "residual_covariance"},
                                   std::pair{frf.input_factor.size(), "input_factor"}})
    if (size == 0)
      fail_request(
          "weighting likelihood needs /{0} in the FRF, which is missing. Estimate the FRF again "
          "with 'stageid frf' from at least two periods, or use noise_variance",
          name);
  const Eigen::Index n_y = frf.n_outputs();
  for (Eigen::Index k = 0; k < frf.lines(); ++k)
    for (Eigen::Index y = 0; y < n_y; ++y)
      if (!(frf.residual_covariance(y * (n_y + 1), k).real() > 0.0))
        throw IndefiniteWeights(
            fmt::format("weighting likelihood: residual_covariance of {} on {} is not positive; "
                        "exclude the output",
                        frf.outputs.names[y], line_name(frf, k)));
}

/// Also scaled to unit diagonal, where the diagonal is not zero.
bool is_semidefinite(const Eigen::MatrixXcd& W) {
  const Eigen::ArrayXd diagonal = W.diagonal().real();
  if (diagonal.minCoeff() < 0.0) return false;
  const Eigen::VectorXd scale = (diagonal > 0.0).select(diagonal.rsqrt(), 1.0).matrix();
  const Eigen::VectorXd values = hermitian_eigenvalues(scale.asDiagonal() * W * scale.asDiagonal());
  return values[0] >= kSemidefinite * std::max(values[W.rows() - 1], 0.0);
}

}  // namespace

// Weights and residual come from different samples (scatter of periods, their mean), so that the
// covariance of an estimate is M^-1 [sum J^H E{W C W} J] M^-1 / 2. For A complex Wishart, n x n with nu
// degrees of freedom and mean nu C, and W = (nu - n) A^-1:
//   E{W} = C^-1,   E{W C W} = nu (nu - n) / ((nu - n)^2 - 1) C^-1.
WeightMatrices WeightMatrices::likelihood(const FrfEstimate& frf) {
  require_factors(frf);
  const Eigen::Index n_y = frf.n_outputs();
  const Eigen::Index n_u = frf.n_inputs();
  const SmoothedCovariance C = smoothed_residual_covariance(frf);
  const double free = C.dof - static_cast<double>(n_y);
  if (C.dof > 0.0 && free < 2.0)
    fail_request(
        "weighting likelihood: the residual covariance of {} outputs has {} degrees of freedom "
        "over all lines but needs {}; measure more periods or realizations, or use noise_variance",
        n_y, C.dof, n_y + 2);
  const double wishart = C.dof > 0.0 ? free / C.dof : 1.0;
  const double one_output = C.dof > 0.0 ? (C.dof - 1.0) / C.dof : 1.0;

  WeightMatrices out;
  if (C.dof > 0.0) out.scatter_factor_ = C.dof * free / (free * free - 1.0);
  out.n_outputs_ = n_y;
  out.outputs_.resize(n_y * n_y, frf.lines());
  out.inputs_.resize(n_u * n_u, frf.lines());
  out.marginal_.resize(n_y * n_u, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd C_E = C.matrices.col(k).reshaped(n_y, n_y);
    const Eigen::MatrixXcd S = frf.input_factor.col(k).reshaped(n_u, n_u);
    out.outputs_.col(k) =
        wishart * inverse_or_refuse(frf, C_E, k, "residual_covariance",
                                    "two outputs are linearly dependent: exclude one of them")
                      .reshaped();
    out.inputs_.col(k) =
        Eigen::MatrixXcd(inverse_or_refuse(frf, S, k, "input_factor",
                                           "two inputs are linearly dependent: exclude one of them")
                             .transpose())
            .reshaped();
    const Eigen::VectorXd y = C_E.diagonal().real();
    const Eigen::RowVectorXd u = S.diagonal().real().transpose();
    out.marginal_.col(k) = one_output * (y * u).cwiseInverse().reshaped();
  }
  return out;
}

WeightMatrices WeightMatrices::user(const FrfEstimate& frf, const Eigen::MatrixXcd& W) {
  const Eigen::Index n_c = frf.response.rows();
  if (W.rows() != n_c * n_c || W.cols() != frf.lines())
    fail_request("weight matrices: the shape must be that of the response in the band");
  require_memory_for_weight_matrices(n_c, frf.lines());
  WeightMatrices out;
  out.whole_ = W;
  out.marginal_.resize(n_c, frf.lines());
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const Eigen::MatrixXcd W_k = W.col(k).reshaped(n_c, n_c);
    if (!W_k.allFinite()) fail_request("weight matrix of {}: is not finite", line_name(frf, k));
    if (!is_hermitian(W_k))
      fail_request(
          "weight matrix of {}: is not Hermitian; element [c, d] must be the conjugate of [d, c]",
          line_name(frf, k));
    const Eigen::MatrixXcd inverse = definite_inverse(W_k);
    if (inverse.size() == 0 && !is_semidefinite(W_k))
      throw IndefiniteWeights(
          fmt::format("weight matrix of {}: is not positive semidefinite, so the cost has no "
                      "minimum; correct it",
                      line_name(frf, k)));
    if (inverse.size() > 0)
      out.marginal_.col(k) = inverse.diagonal().real().cwiseInverse();
    else
      out.marginal_.col(k) = W_k.diagonal().real().cwiseMax(0.0);
  }
  if (!(out.marginal_.maxCoeff() > 0.0))
    fail_request("weight matrices: all are zero; at least one must be nonzero");
  return out;
}

SplitMatrix WeightMatrices::between(Eigen::Index c, Eigen::Index d, Eigen::Index first,
                                    Eigen::Index lines) const {
  const Eigen::Index n_c = marginal_.rows();
  Eigen::ArrayXcd W(lines);
  if (whole_.size() > 0) {
    W = whole_.row(c + n_c * d).segment(first, lines).transpose();
  } else {
    const Eigen::Index n_y = n_outputs_;
    const Eigen::Index n_u = n_c / n_y;
    // (S^-1)(u, v), stored transposed, times C_E^-1(y, z).
    W = inputs_.row(d / n_y + n_u * (c / n_y)).segment(first, lines).transpose().array() *
        outputs_.row(c % n_y + n_y * (d % n_y)).segment(first, lines).transpose().array();
  }
  return {W.real().matrix(), W.imag().matrix()};
}

void WeightMatrices::apply(Eigen::Index first, Eigen::MatrixXcd& tile) const {
  if (whole_.size() > 0) {
    const Eigen::Index n_c = tile.rows();
    Eigen::VectorXcd weighted(n_c);
    for (Eigen::Index j = 0; j < tile.cols(); ++j) {
      const Eigen::Map<const Eigen::MatrixXcd> W(whole_.col(first + j).data(), n_c, n_c);
      weighted.noalias() = W * tile.col(j);
      tile.col(j) = weighted;
    }
    return;
  }
  const Eigen::Index n_y = n_outputs_;
  const Eigen::Index n_u = tile.rows() / n_y;
  Eigen::MatrixXcd half(n_y, n_u);
  for (Eigen::Index j = 0; j < tile.cols(); ++j) {
    // vec(C^-1 X (S^-1)^T) = (S^-1 kron C^-1) vec X
    const Eigen::Map<const Eigen::MatrixXcd> left(outputs_.col(first + j).data(), n_y, n_y);
    const Eigen::Map<const Eigen::MatrixXcd> right(inputs_.col(first + j).data(), n_u, n_u);
    Eigen::Map<Eigen::MatrixXcd> X(tile.col(j).data(), n_y, n_u);
    half.noalias() = left.lazyProduct(X);
    X.noalias() = half * right;
  }
}

std::optional<WeightMatrices> make_weight_matrices(const FrfEstimate& frf,
                                                   const FitOptions& options) {
  if (options.weighting == Weighting::likelihood) return WeightMatrices::likelihood(frf);
  if (options.weighting == Weighting::user && options.user_weight_matrices.size() > 0)
    return WeightMatrices::user(frf, options.user_weight_matrices);
  return std::nullopt;
}

void require_memory_for_weight_matrices(Eigen::Index channels, Eigen::Index lines) {
  const double bytes = 16.0 * static_cast<double>(channels) * static_cast<double>(channels) *
                       static_cast<double>(lines);
  if (bytes <= kLargestBytes) return;
  fail_request(
      "weight matrices: {} x {} on {} lines need {:.1f} GiB of memory, more than the "
      "limit of {:.0f} GiB. Choose fewer channels, a smaller band, or weighting "
      "likelihood, which needs less memory",
      channels, channels, lines, bytes / 1073741824.0, kLargestBytes / 1073741824.0);
}

}  // namespace stageid
