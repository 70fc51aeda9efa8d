#include "estimation/equations/residue_form.hpp"

#include <Eigen/QR>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "estimation/equations/weighted_low_rank.hpp"
#include "excitation/decompositions/decompositions.hpp"

namespace stageid {
namespace {

using Complex = std::complex<double>;

/// The pole of 1 + a_1 s + a_2 s^2 with positive imaginary part, and its derivatives.
struct Pole {
  Complex value;
  Complex d_a1;
  Complex d_a2;
};
Pole pole_of(const Eigen::VectorXd& a) {
  const double re = -0.5 * a[0] / a[1];
  const double im = std::sqrt(std::max(1.0 / a[1] - re * re, 1e-12 / a[1]));
  const Complex d1(-0.5 / a[1], 0.5 * re / (a[1] * im));
  const double d2_re = -re / a[1];
  const Complex d2(d2_re, (-0.5 / (a[1] * a[1]) - re * d2_re) / im);
  return {{re, im}, d1, d2};
}

}  // namespace

ResidueForm::ResidueForm(const SubmodelShape& shape, int rank, Eigen::Index n_outputs,
                         Eigen::Index n_inputs)
    : n_y_(n_outputs), n_u_(n_inputs), functions_(shape.functions()), rank_(rank) {
  if (rank <= 0 || rank >= std::min(n_y_, n_u_)) {
    rank_ = 0;
    rho_size_ = n_y_ * n_u_ * functions_;
    return;
  }
  if (functions_ == 1) {
    kind_ = Kind::real;
    rho_size_ = rank_ * (n_y_ + n_u_ - rank_);
  } else if (functions_ == 2 && shape.order == 2 && shape.integrators == 0 && rank == 1) {
    kind_ = Kind::complex;
    rho_size_ = 2 * (n_y_ + n_u_ - 1);
  } else {
    throw std::invalid_argument(
        "a residue rank is supported only for submodels with one numerator coefficient, and rank 1 "
        "also for modes with two");
  }
}

void ResidueForm::project(const Eigen::VectorXd& a, const Eigen::MatrixXd& B,
                          const Eigen::MatrixXd& weight) {
  full_ = B;
  if (kind_ == Kind::full) return;
  Eigen::MatrixXcd L = B.col(0).reshaped(n_y_, n_u_).cast<Complex>();
  if (kind_ == Kind::complex) {
    const Pole pole = pole_of(a);
    const Eigen::VectorXd re = 0.5 / a[1] * B.col(1);
    const Eigen::VectorXd im =
        (-0.5 / a[1] * B.col(0) - pole.value.real() * re) / pole.value.imag();
    L.real() = re.reshaped(n_y_, n_u_);
    L.imag() = im.reshaped(n_y_, n_u_);
  }
  WeightedLowRank::Factors factors = WeightedLowRank(L, weight).factors(rank_);
  phi_ = std::move(factors.phi);
  psi_ = std::move(factors.psi);
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXcd> qr(psi_.transpose());
  free_input_.assign(n_u_, 0);
  Eigen::MatrixXcd held(rank_, rank_);
  for (Eigen::Index r = 0; r < rank_; ++r) {
    const Eigen::Index input = qr.colsPermutation().indices()[r];
    held.row(r) = psi_.row(input);
    free_input_[input] = -1 - r;
  }
  psi_ = psi_ * inverse(held);
  phi_ = phi_ * held.transpose();
  Eigen::Index place = 0;
  for (Eigen::Index u = 0; u < n_u_; ++u) {
    Eigen::Index& free = free_input_[u];
    if (free < 0) {
      psi_.row(u).setZero();
      psi_(u, -1 - free) = 1.0;
      free = -1;
    } else {
      free = place++;
    }
  }
}

Eigen::MatrixXd ResidueForm::numerators(const Eigen::VectorXd& a) const {
  if (kind_ == Kind::full) return full_;
  const Eigen::MatrixXcd L = phi_ * psi_.transpose();
  if (kind_ == Kind::real) return L.real().reshaped(n_y_ * n_u_, 1);
  Eigen::MatrixXd B(n_y_ * n_u_, 2);
  B.col(0) = (-2.0 * a[1] * (std::conj(pole_of(a).value) * L).real()).reshaped();
  B.col(1) = (2.0 * a[1] * L.real()).reshaped();
  return B;
}

/// Parameters in the order phi (output fastest), the free rows of psi (input fastest); complex ones
/// as real part, imaginary part.
Eigen::Index ResidueForm::psi_parameter(Eigen::Index input, Eigen::Index column) const {
  const Eigen::Index place = free_input_[input];
  return place < 0 ? -1 : n_y_ * rank_ + place + (n_u_ - rank_) * column;
}

void ResidueForm::derivatives(const Eigen::VectorXd& a, Eigen::Index channel,
                              std::vector<Derivative>& out) const {
  out.clear();
  if (kind_ == Kind::full) {
    for (Eigen::Index m = 0; m < functions_; ++m)
      out.push_back({m, channel + n_y_ * n_u_ * m, 1.0});
    return;
  }
  const Eigen::Index y = channel % n_y_;
  const Eigen::Index u = channel / n_y_;
  if (kind_ == Kind::real) {
    for (Eigen::Index r = 0; r < rank_; ++r) {
      out.push_back({0, y + n_y_ * r, psi_(u, r).real()});
      if (const Eigen::Index p = psi_parameter(u, r); p >= 0)
        out.push_back({0, p, phi_(y, r).real()});
    }
    return;
  }
  const Pole pole = pole_of(a);
  const Complex L = phi_(y, 0) * psi_(u, 0);
  const Complex j(0.0, 1.0);
  // dB for a change dL: B_0 by -2 a_2 Re(conj(lambda) dL), B_1 by 2 a_2 Re dL.
  const auto add = [&](Eigen::Index parameter, Complex dL) {
    out.push_back({0, parameter, -2.0 * a[1] * (std::conj(pole.value) * dL).real()});
    out.push_back({1, parameter, 2.0 * a[1] * dL.real()});
  };
  add(2 * y, psi_(u, 0));
  add(2 * y + 1, j * psi_(u, 0));
  if (const Eigen::Index p = psi_parameter(u, 0); p >= 0) {
    add(2 * p, phi_(y, 0));
    add(2 * p + 1, j * phi_(y, 0));
  }
  out.push_back({0, -1, -2.0 * a[1] * (std::conj(pole.d_a1) * L).real()});
  out.push_back(
      {0, -2,
       -2.0 * (std::conj(pole.value) * L).real() - 2.0 * a[1] * (std::conj(pole.d_a2) * L).real()});
  out.push_back({1, -2, 2.0 * L.real()});
}

void ResidueForm::step(const Eigen::Ref<const Eigen::VectorXd>& step) {
  if (kind_ == Kind::full) {
    full_.reshaped() += step;
    return;
  }
  const Eigen::Index parts = kind_ == Kind::complex ? 2 : 1;
  const auto change = [&](Eigen::Index parameter) {
    return parts == 2 ? Complex(step[2 * parameter], step[2 * parameter + 1])
                      : Complex(step[parameter], 0.0);
  };
  for (Eigen::Index r = 0; r < rank_; ++r) {
    for (Eigen::Index y = 0; y < n_y_; ++y) phi_(y, r) += change(y + n_y_ * r);
    for (Eigen::Index u = 0; u < n_u_; ++u)
      if (const Eigen::Index p = psi_parameter(u, r); p >= 0) psi_(u, r) += change(p);
  }
}

}  // namespace stageid
