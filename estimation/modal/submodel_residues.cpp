#include "estimation/modal/submodel_residues.hpp"

#include <cmath>

#include "acquisition/files/fail.hpp"
#include "estimation/modal/singular_shapes.hpp"
#include "estimation/model/basis.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// All poles, conjugates too.
std::vector<Complex> all_poles(const std::vector<Complex>& representatives) {
  std::vector<Complex> out;
  for (const Complex pole : representatives) {
    out.push_back(pole);
    if (pole.imag() != 0.0) out.push_back(std::conj(pole));
  }
  return out;
}

/// Partial fractions of closer poles lose too many digits: the residues grow as the inverse distance, and the poles,
/// as roots of A, have errors of the square root of rounding.
void require_distinct(const std::vector<Complex>& poles, std::size_t index) {
  constexpr double kClosest = 1e-6;
  for (std::size_t i = 0; i < poles.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (std::abs(poles[i] - poles[j]) <= kClosest * std::abs(poles[i]))
        fail_request(
            "model: submodel {}: its poles {:.6g}{:+.6g}j and {:.6g}{:+.6g}j rad/s "
            "coincide; a state space needs distinct poles within a submodel",
            index, poles[j].real(), poles[j].imag(), poles[i].real(), poles[i].imag());
}

}  // namespace

std::vector<Complex> pole_representatives(const Submodel& submodel) {
  std::vector<Complex> out = roots(submodel.coefficients());
  std::erase_if(out, [](Complex pole) { return !(pole.imag() >= 0.0); });
  return out;
}

Eigen::MatrixXcd numerator_at(const Submodel& submodel, Complex s) {
  Eigen::MatrixXcd B = submodel.numerator.back().cast<Complex>();
  for (std::size_t m = submodel.numerator.size() - 1; m-- > 0;)
    B = B * s + submodel.numerator[m].cast<Complex>();
  return B;
}

SubmodelResidues residues(const Submodel& submodel, std::size_t index) {
  const int l = submodel.integrators;
  const auto order = static_cast<std::size_t>(submodel.order() + l);
  const auto& B = submodel.numerator;
  if (l < 0 || l > 2) fail_request("model: submodel {}: must have 0, 1 or 2 integrators", index);
  if (B.empty() || B.size() > order + 1)
    fail_request("model: submodel {}: must be proper and have at least one numerator", index);
  const std::vector<Complex> representatives = pole_representatives(submodel);
  const std::vector<Complex> poles = all_poles(representatives);
  require_distinct(poles, index);

  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(B[0].rows(), B[0].cols());
  SubmodelResidues out{zero, zero, zero, {}};
  const double highest = submodel.denominator.back();
  if (B.size() == order + 1) out.direct = B.back() / highest;
  if (l == 1) out.integrator = B[0];
  if (l == 2) {
    out.double_integrator = B[0];
    if (B.size() > 1) out.integrator = B[1];
    if (submodel.denominator.size() > 1) out.integrator -= submodel.denominator[1] * B[0];
  }
  for (const Complex pole : representatives) {
    Complex slope = std::pow(pole, l) * highest;  // d/ds of s^l A(s) at the pole
    for (const Complex other : poles)
      if (other != pole) slope *= pole - other;
    out.poles.push_back({pole, numerator_at(submodel, pole) / slope});
  }
  return out;
}

Eigen::Index residue_rank(const Submodel& submodel, std::size_t index,
                          const Eigen::VectorXd& singular_values) {
  constexpr double kContradiction = 1e-6;
  const Eigen::Index rank = numerical_rank(singular_values, singular_values[0]);
  if (!submodel.residue_rank || *submodel.residue_rank >= rank) return rank;
  const Eigen::Index held = *submodel.residue_rank;
  const double excess = singular_values[held] / singular_values[0];
  if (excess > kContradiction)
    fail_request(
        "model: submodel {}: residue_rank is {}, but singular value {} of its residue "
        "is {:.1e} of the first; correct residue_rank or omit it",
        index, held, held + 1, excess);
  return held;
}

}  // namespace stageid
