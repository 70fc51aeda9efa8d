#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Derivatives of the shapes and the mass of a mode (see mode_shapes()) to a_1, a_2, vec B_0 and, with general
/// damping, vec B_1: one column each. The derivative of a singular vector is
///   du_1 = sum_r u_r (s_1 u_r^H dM v_1 + s_r (u_1^H dM v_r)^*) / (s_1^2 - s_r^2) + (the rest of dM v_1) / s_1,
/// then both shapes are rotated so that the leading component remains real.
/// Source: J. R. Magnus and H. Neudecker, Matrix Differential Calculus, 3rd ed. (2007), chapter 8.
struct ModeShapeSlopes {
  Eigen::MatrixXcd output_shape;  ///< n_y x parameters
  Eigen::MatrixXcd input_shape;   ///< n_u x parameters
  Eigen::RowVectorXd modal_mass;
};
ModeShapeSlopes mode_shape_slopes(const Submodel& mode);

/// Their standard deviations. @param covariance of those parameters
/// @returns empty if a deviation is not finite: the mode has no shape, or two equal poles
std::optional<ModeShapeDeviation> mode_shape_deviation(const Submodel& mode,
                                                       const Eigen::MatrixXd& covariance);

/// Fills Submodel::shape_std of every mode, or of none if the covariances would be too large.
void fill_shape_deviations(const FrfEstimate& frf, const FitOptions& options, FitResult& result);

}  // namespace stageid
