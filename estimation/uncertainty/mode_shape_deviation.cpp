#include "estimation/uncertainty/mode_shape_deviation.hpp"

#include <cmath>
#include <vector>

#include "estimation/modal/mode_shapes.hpp"
#include "estimation/modal/singular_shapes.hpp"
#include "estimation/modal/submodel_residues.hpp"
#include "estimation/uncertainty/dense_covariance.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// M = B(lambda) / a_2 as mode_shapes() decomposes it.
class ModeResidue {
 public:
  explicit ModeResidue(const Submodel& mode)
      : mode_(mode),
        lambda_(described_pole(mode)),
        M_(numerator_at(mode, lambda_) / mode.denominator[2]),
        svd_(svd(M_, Eigen::ComputeFullU | Eigen::ComputeFullV)) {
    const ModeShape shape = mode_shape(mode, 0);
    if (!(svd_.singularValues()[0] > 0.0)) return;
    // The shapes are the first singular vectors, rotated by the same phase.
    const Complex turn = svd_.matrixU().col(0).dot(shape.output_shape);
    u_ = turn * svd_.matrixU();
    v_ = turn * svd_.matrixV();
    const Eigen::ArrayXd size = shape.output_shape.cwiseAbs();
    while (size[leading_] < kLeadingComponent * size.maxCoeff()) ++leading_;
  }

  Eigen::Index parameters() const { return 2 + M_.size() * std::ssize(mode_.numerator); }

  /// dM / da_q, q = 1, 2: through the pole and through 1 / a_2.
  Eigen::MatrixXcd denominator_slope(Eigen::Index q) const {
    const double a1 = mode_.denominator[1];
    const double a2 = mode_.denominator[2];
    const Complex dlambda = -std::pow(lambda_, static_cast<int>(q)) / (a1 + 2.0 * a2 * lambda_);
    Eigen::MatrixXcd out = Eigen::MatrixXcd::Zero(M_.rows(), M_.cols());
    if (mode_.numerator.size() > 1) out = mode_.numerator[1] * (dlambda / a2);
    if (q == 2) out -= M_ / a2;
    return out;
  }
  /// dM(c) / dB_m(c).
  Complex numerator_slope(std::size_t m) const {
    return (m == 0 ? Complex(1.0) : lambda_) / mode_.denominator[2];
  }

  /// Adds the effect of parameter p, whose derivative of M is dM.
  void slope(const Eigen::MatrixXcd& dM, Eigen::Index p, ModeShapeSlopes& out) const {
    const Eigen::VectorXd& s = svd_.singularValues();
    const Eigen::VectorXcd left = u_.adjoint() * (dM * v_.col(0));             // u_r^H dM v_1
    const Eigen::VectorXcd right = v_.adjoint() * (dM.adjoint() * u_.col(0));  // v_r^H dM^H u_1
    Eigen::VectorXcd along_u = left / s[0];
    Eigen::VectorXcd along_v = right / s[0];
    for (Eigen::Index r = 1; r < s.size(); ++r) {
      const double gap = s[0] * s[0] - s[r] * s[r];
      along_u[r] = (s[0] * left[r] + s[r] * right[r]) / gap;
      along_v[r] = (s[0] * right[r] + s[r] * left[r]) / gap;
    }
    along_u[0] = Complex(0.0, left[0].imag() / s[0]);
    along_v[0] = 0.0;
    Eigen::VectorXcd du = u_ * along_u;
    Eigen::VectorXcd dv = v_ * along_v;
    const Complex turn(0.0, -du[leading_].imag() / u_(leading_, 0).real());
    du += turn * u_.col(0);
    dv += turn * v_.col(0);
    out.output_shape.col(p) = du;
    out.input_shape.col(p) = dv.conjugate();
    out.modal_mass[p] = -left[0].real() / (s[0] * s[0]);
  }

 private:
  const Submodel& mode_;
  Complex lambda_;
  Eigen::MatrixXcd M_;
  Eigen::BDCSVD<Eigen::MatrixXcd> svd_;
  Eigen::MatrixXcd u_;
  Eigen::MatrixXcd v_;
  Eigen::Index leading_ = 0;
};

/// sqrt of the diagonal of J C J^T.
Eigen::VectorXd deviations(const Eigen::MatrixXd& J, const Eigen::MatrixXd& C) {
  return (J * C).cwiseProduct(J).rowwise().sum().cwiseMax(0.0).cwiseSqrt();
}

Eigen::VectorXcd deviations(const Eigen::MatrixXcd& J, const Eigen::MatrixXd& C) {
  Eigen::VectorXcd out(J.rows());
  out.real() = deviations(Eigen::MatrixXd(J.real()), C);
  out.imag() = deviations(Eigen::MatrixXd(J.imag()), C);
  return out;
}

}  // namespace

ModeShapeSlopes mode_shape_slopes(const Submodel& mode) {
  const ModeResidue residue(mode);
  const Eigen::Index n_y = mode.numerator[0].rows();
  const Eigen::Index n_u = mode.numerator[0].cols();
  ModeShapeSlopes out;
  out.output_shape.resize(n_y, residue.parameters());
  out.input_shape.resize(n_u, residue.parameters());
  out.modal_mass.resize(residue.parameters());
  Eigen::Index p = 0;
  for (const Eigen::Index q : {1, 2}) residue.slope(residue.denominator_slope(q), p++, out);
  Eigen::MatrixXcd dM = Eigen::MatrixXcd::Zero(n_y, n_u);
  for (std::size_t m = 0; m < mode.numerator.size(); ++m)
    for (Eigen::Index c = 0; c < dM.size(); ++c) {
      dM.reshaped()[c] = residue.numerator_slope(m);
      residue.slope(dM, p++, out);
      dM.reshaped()[c] = 0.0;
    }
  return out;
}

std::optional<ModeShapeDeviation> mode_shape_deviation(const Submodel& mode,
                                                       const Eigen::MatrixXd& covariance) {
  const ModeShapeSlopes slopes = mode_shape_slopes(mode);
  const ModeShapeDeviation out = {deviations(slopes.output_shape, covariance),
                                  deviations(slopes.input_shape, covariance),
                                  deviations(Eigen::MatrixXd(slopes.modal_mass), covariance)[0]};
  if (!out.output_shape.allFinite() || !out.input_shape.allFinite() ||
      !std::isfinite(out.modal_mass))
    return std::nullopt;
  return out;
}

void fill_shape_deviations(const FrfEstimate& frf, const FitOptions& options, FitResult& result) {
  const std::vector<DataRange> all = functions_of_submodels(result.model);
  std::vector<DataRange> ranges;
  std::vector<std::size_t> modes;
  for (std::size_t i = 0; i < result.model.submodels.size(); ++i)
    if (result.model.submodels[i].is_mode()) {
      modes.push_back(i);
      ranges.push_back(all[i]);
    }
  if (modes.empty()) return;
  const std::vector<FitCovariance> covariances = dense_covariances(frf, result, options, ranges);
  for (std::size_t m = 0; m < covariances.size(); ++m) {
    Submodel& mode = result.model.submodels[modes[m]];
    Eigen::Index first = 0;
    for (std::size_t i = 0; i < modes[m]; ++i) first += result.model.submodels[i].order();
    const Eigen::MatrixXd& C = covariances[m].sandwich;
    const Eigen::Index numerators = mode.numerator[0].size() * std::ssize(mode.numerator);
    std::vector<Eigen::Index> places = {first, first + 1};
    for (Eigen::Index b = C.rows() - numerators; b < C.rows(); ++b) places.push_back(b);
    mode.shape_std = mode_shape_deviation(mode, C(places, places));
  }
}

}  // namespace stageid
