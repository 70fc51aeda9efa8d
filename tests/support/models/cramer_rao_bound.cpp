#include "tests/support/models/cramer_rao_bound.hpp"

#include <cmath>
#include <functional>
#include <utility>

#include "excitation/decompositions/decompositions.hpp"
#include "tests/support/models/model_reference.hpp"

namespace stageid::test {
namespace {

/// Of the central differences: part of a half-power width, of a damping ratio, of the time in which
/// the fastest line turns by a radian. Its fourth power is their error.
constexpr double kStep = 1e-3;

/// One submodel seen by one channel with numerator 1.
AdditiveModel unit_model(const AdditiveModel& truth, const Submodel& submodel) {
  AdditiveModel unit;
  unit.inputs.names = {"u"};
  unit.outputs.names = {"y"};
  unit.sample_rate_hz = truth.sample_rate_hz;
  unit.input_delay_s = truth.input_delay_s.head(1);
  unit.output_delay_s = truth.output_delay_s.head(1);
  unit.submodels = {submodel};
  unit.submodels[0].numerator = {Eigen::MatrixXd::Ones(1, 1)};
  return unit;
}

/// Functions of frequency that all channels share, N x submodels.
struct SharedFunctions {
  Eigen::MatrixXcd value;
  Eigen::MatrixXcd to_frequency;
  Eigen::MatrixXcd to_damping;
  Eigen::MatrixXcd to_delay;
};

SharedFunctions shared_functions(const AdditiveModel& truth, const Eigen::VectorXd& frequency_hz,
                                 HoldModel hold) {
  const auto count = static_cast<Eigen::Index>(truth.submodels.size());
  SharedFunctions out;
  for (Eigen::MatrixXcd* matrix : {&out.value, &out.to_frequency, &out.to_damping, &out.to_delay})
    matrix->setZero(frequency_hz.size(), count);
  const auto slope = [&](double h, const std::function<AdditiveModel(double)>& moved) {
    const auto at = [&](double by) -> Eigen::VectorXcd {
      return reference_response(moved(by), frequency_hz, hold).transpose();
    };
    return Eigen::VectorXcd((8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h));
  };
  for (Eigen::Index i = 0; i < count; ++i) {
    const AdditiveModel unit = unit_model(truth, truth.submodels[i]);
    out.value.col(i) = reference_response(unit, frequency_hz, hold).transpose();
    out.to_delay.col(i) = slope(kStep / (6.3 * frequency_hz.maxCoeff()), [&](double by) {
      AdditiveModel moved = unit;
      moved.input_delay_s.array() += by;
      return moved;
    });
    const Submodel& s = unit.submodels[0];
    if (!s.is_mode()) continue;
    const double f = s.natural_frequency_hz();
    const double zeta = s.damping_ratio();
    const auto with = [&](double f_hz, double damping) {
      AdditiveModel moved = unit;
      const std::vector<double> a = mode_coefficients(f_hz, damping);
      moved.submodels[0].denominator = {1.0, a[0], a[1]};
      return moved;
    };
    out.to_frequency.col(i) =
        slope(kStep * zeta * f, [&](double by) { return with(f + by, zeta); });
    out.to_damping.col(i) = slope(kStep * zeta, [&](double by) { return with(f, zeta + by); });
  }
  return out;
}

Eigen::MatrixXd triangular_factor(Eigen::MatrixXd m) {
  qr_in_place(m);
  return m.topRows(m.cols()).triangularView<Eigen::Upper>();
}

/// Triangular factor of one channel's weighted real matrix [numerators, shared unknowns].
Eigen::MatrixXd channel_factor(const SharedFunctions& shared, const Eigen::VectorXd& B,
                               const Eigen::VectorXd& deviation) {
  const Eigen::Index n = B.size();
  const Eigen::Index N = shared.value.rows();
  Eigen::MatrixXcd J(N, 3 * n + 1);
  J << shared.value, shared.to_frequency * B.asDiagonal(), shared.to_damping * B.asDiagonal(),
      shared.to_delay * B;
  J.array().colwise() /= deviation.array();
  Eigen::MatrixXd tall(2 * N, J.cols());
  tall << J.real(), J.imag();
  return triangular_factor(std::move(tall));
}

Eigen::MatrixXd upper_inverse(const Eigen::MatrixXd& R) {
  return R.triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(R.rows(), R.cols()));
}

}  // namespace

CramerRaoBound cramer_rao_bound(const AdditiveModel& truth, const Eigen::VectorXd& frequency_hz,
                                HoldModel hold, const Eigen::MatrixXd& variance) {
  const SharedFunctions shared = shared_functions(truth, frequency_hz, hold);
  const auto n = static_cast<Eigen::Index>(truth.submodels.size());
  std::vector<Eigen::Index> unknown;  // of the 2 n + 1 shared ones: those of submodels with poles
  for (Eigen::Index i = 0; i < 2 * n; ++i)
    if (truth.submodels[i % n].is_mode()) unknown.push_back(i);
  unknown.push_back(2 * n);
  const auto m = static_cast<Eigen::Index>(unknown.size());

  std::vector<Eigen::MatrixXd> factors;
  Eigen::MatrixXd rest(variance.rows() * m, m);  // what the numerators cannot follow
  for (Eigen::Index c = 0; c < variance.rows(); ++c) {
    Eigen::VectorXd B(n);
    for (Eigen::Index i = 0; i < n; ++i) B[i] = truth.submodels[i].numerator[0].reshaped()[c];
    const Eigen::VectorXd deviation = variance.row(c).transpose().cwiseSqrt();
    Eigen::MatrixXd R = channel_factor(shared, B, deviation);
    const Eigen::MatrixXd lower = R.bottomRightCorner(2 * n + 1, 2 * n + 1)(Eigen::all, unknown);
    rest.middleRows(c * m, m) = triangular_factor(lower);
    factors.push_back(std::move(R));
  }
  const Eigen::MatrixXd root = upper_inverse(triangular_factor(std::move(rest))) / std::sqrt(2.0);

  CramerRaoBound bound;
  bound.frequency_std_hz.setZero(n);
  bound.damping_std.setZero(n);
  for (Eigen::Index p = 0; p + 1 < m; ++p) {
    const Eigen::Index at = unknown[p];
    (at < n ? bound.frequency_std_hz : bound.damping_std)[at % n] = root.row(p).norm();
  }
  bound.numerator_std.assign(truth.submodels.size(), truth.submodels[0].numerator[0]);
  for (Eigen::Index c = 0; c < variance.rows(); ++c) {
    const Eigen::MatrixXd& R = factors[c];
    const Eigen::MatrixXd own = upper_inverse(R.topLeftCorner(n, n));
    const Eigen::MatrixXd border = R.topRightCorner(n, 2 * n + 1)(Eigen::all, unknown);
    const Eigen::MatrixXd through = own * border * root;
    for (Eigen::Index i = 0; i < n; ++i)
      bound.numerator_std[i].reshaped()[c] =
          std::sqrt(0.5 * own.row(i).squaredNorm() + through.row(i).squaredNorm());
  }
  return bound;
}

}  // namespace stageid::test
