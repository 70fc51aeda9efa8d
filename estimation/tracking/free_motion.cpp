#include "estimation/tracking/free_motion.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "estimation/model/basis.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

/// Directions of the outputs with less than this share of the largest residue are not those of the mode.
constexpr double kOfShape = 1e-3;

/// The outputs that a submodel moves, n_y x rank, orthonormal. @param omega_rad_s of its fastest pole
Eigen::MatrixXd shapes_of(const Submodel& submodel, double omega_rad_s) {
  const Eigen::Index n_u = submodel.numerator.front().cols();
  Eigen::MatrixXd all(submodel.numerator.front().rows(), n_u * std::ssize(submodel.numerator));
  for (Eigen::Index p = 0; p < std::ssize(submodel.numerator); ++p)
    all.middleCols(p * n_u, n_u) = submodel.numerator[p] * std::pow(omega_rad_s, p);
  Eigen::BDCSVD<Eigen::MatrixXd> parts = svd(all, Eigen::ComputeThinU);
  parts.setThreshold(kOfShape);
  return parts.matrixU().leftCols(parts.rank());
}

/// shape x spectrum for all of both, with norm 1
Eigen::MatrixXcd products(const Eigen::MatrixXd& shapes,
                          const std::vector<Eigen::ArrayXcd>& spectra) {
  Eigen::MatrixXcd out(shapes.rows() * spectra.front().size(), shapes.cols() * std::ssize(spectra));
  Eigen::Index column = 0;
  for (const Eigen::ArrayXcd& spectrum : spectra)
    for (const auto shape : shapes.colwise())
      out.col(column++) = (shape * spectrum.matrix().transpose()).reshaped().normalized();
  return out;
}

}  // namespace

std::vector<Eigen::MatrixXcd> free_motions(const TrackedResponse& response) {
  const AdditiveModel& model = response.model();
  const std::complex<double> j(0.0, 1.0);
  const Eigen::ArrayXcd q = (response.omega_rad_s().array() * (-j / model.sample_rate_hz)).exp();
  std::vector<Eigen::MatrixXcd> out = {
      products(Eigen::MatrixXd::Identity(model.n_outputs(), model.n_outputs()),
               {1.0 / (1.0 - q), 1.0 / (1.0 - q).square()})};
  for (const Submodel& submodel : model.submodels) {
    std::vector<Eigen::ArrayXcd> spectra;
    double fastest_rad_s = 0.0;
    for (const std::complex<double> pole : roots(submodel.coefficients())) {
      fastest_rad_s = std::max(fastest_rad_s, std::abs(pole));
      const Eigen::ArrayXcd one = 1.0 / (1.0 - std::exp(pole / model.sample_rate_hz) * q);
      const Eigen::ArrayXcd other =
          1.0 / (1.0 - std::exp(std::conj(pole) / model.sample_rate_hz) * q);
      if (pole.imag() == 0.0) spectra.push_back(one);
      if (pole.imag() > 0.0) spectra.insert(spectra.end(), {one * other, q * one * other});
    }
    if (!spectra.empty()) out.push_back(products(shapes_of(submodel, fastest_rad_s), spectra));
  }
  return out;
}

}  // namespace stageid
