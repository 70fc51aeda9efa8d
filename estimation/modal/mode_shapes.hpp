#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

#include "estimation/model/additive_model.hpp"

namespace stageid {

/// A mode in mechanical form: natural frequency, damping ratio, shapes at the outputs and inputs.
///
/// With the pole lambda = omega (-zeta + j sqrt(1 - zeta^2)) and its residue R the mode is
///   P_i(s) = R/(s - lambda) + conj(R)/(s - conj(lambda)),
///   2 j omega sqrt(1 - zeta^2) R = B(lambda)/a_2 = output_shape input_shape^T / modal_mass.
/// Both shapes have norm one; the leading component of output_shape is real and positive (the first of
/// at least 0.9 of the largest magnitude), the modal mass is positive. For numerators B_0 the shapes are
/// real and P_i = output_shape input_shape^T / (modal_mass (s^2 + 2 zeta omega s + omega^2)); for
/// B_0 + B_1 s (general viscous damping) they are complex. Units: those of input over output times
/// s^-2, so kg for N and m; with outputs of several units the norm, and so the mass, depends on them.
///
/// A residue of higher rank is represented by its largest singular value; `not_rank_one` is the relative size
/// of the next one. An overdamped mode (two real poles) is described at its slower pole.
struct ModeShape {
  std::size_t submodel = 0;  ///< index into the model's
  double natural_frequency_hz = 0.0;
  double damping_ratio = 0.0;
  Eigen::VectorXcd output_shape;  ///< n_y
  Eigen::VectorXcd input_shape;   ///< n_u
  double modal_mass = 0.0;        ///< infinite, and the shapes zero, if the numerators are zero
  double not_rank_one = 0.0;      ///< second singular value over the first
};

/// The mechanical form of a submodel. @param index of the submodel in its model  @pre submodel.is_mode()
ModeShape mode_shape(const Submodel& submodel, std::size_t index);
/// The pole used for the shapes: with positive imaginary part, or the slower of two real ones.
std::complex<double> described_pole(const Submodel& mode);

/// The modes of a model, in its order. Source: D. J. Ewins, Modal Testing, 2nd ed. (2000), section 2.8, for the shapes
/// of general viscous damping.
std::vector<ModeShape> mode_shapes(const AdditiveModel& model);

/// An output and an input at the same position and in the same direction.
struct DrivingPoint {
  Eigen::Index output = 0;
  Eigen::Index input = 0;
};

/// Mass of a mode at a driving point: modal_mass / Re(output_shape_i input_shape_j). It depends neither on the norm of
/// the shapes nor on the other outputs and inputs. Negative if the mode contradicts a driving point, infinite in a
/// node.
/// @throws std::invalid_argument if an index is out of range.
double driving_point_mass(const ModeShape& mode, const DrivingPoint& point);

/// The double integrator, sum over degrees of freedom r of output_r input_r^T / (mass_r s^2), by singular values;
/// norms, signs and units as for modes. The directions are those in which the channels observe the body, most mobile
/// first, not its centre of mass and principal axes.
struct RigidBody {
  Eigen::MatrixXd output_shape;  ///< n_y x rank
  Eigen::MatrixXd input_shape;   ///< n_u x rank
  Eigen::VectorXd mass;          ///< rank, rising
  Eigen::Index rank() const noexcept { return mass.size(); }
};

/// The rank is the submodel's residue_rank if held, else numerical. In a free fit, noise makes it full: spurious
/// directions are recognized only by masses out of proportion. Rank 0 without double integrator.
/// @throws std::invalid_argument if residue_rank contradicts the numerators.
RigidBody rigid_body(const AdditiveModel& model);

}  // namespace stageid
