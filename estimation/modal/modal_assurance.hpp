#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/modal/mode_shapes.hpp"

namespace stageid {

/// Modal assurance criterion between the columns of two sets of shapes on the same channels,
///   MAC(a, b) = |phi_a^H phi_b|^2 / (|phi_a|^2 |phi_b|^2),
/// 1 for shapes that are multiples of each other, 0 for orthogonal ones and for a zero shape.
/// For two random shapes on n channels it is about 1/n: four sensors cannot distinguish seventeen modes.
/// @return columns of a x columns of b
/// @throws std::invalid_argument if the channels differ in number.
/// Source: R. J. Allemang and D. L. Brown, Proc. 1st IMAC (1982) 110.
Eigen::MatrixXd modal_assurance(const Eigen::MatrixXcd& a, const Eigen::MatrixXcd& b);

/// Output shapes of the modes as columns.
Eigen::MatrixXcd output_shapes(const std::vector<ModeShape>& modes);
Eigen::MatrixXcd input_shapes(const std::vector<ModeShape>& modes);

/// Relative difference of the frequencies above which modes are not paired.
inline constexpr double kMostModeDifference = 0.05;

/// Two modes that are considered the same.
struct ModePair {
  std::size_t first = 0;              ///< index into the first set
  std::size_t second = 0;             ///< index into the second
  double frequency_difference = 0.0;  ///< (f_second - f_first) / f_first
  double output_mac = 0.0;
  double input_mac = 0.0;
};

/// Pairs modes of two models with the same channels by frequency and shape, each at most once.
///
/// The score of a pair is  MAC_output MAC_input (1 - |frequency difference| / 5 %),  where the product of the
/// two MACs is the MAC of the residues phi psi^T. The best pair is chosen first, then the best of the rest.
/// Close modes are thus distinguished by their shapes, and similar shapes by their frequencies. Modes more than 5 %
/// apart, or whose residues have a MAC below 0.1, are not paired.
/// @return in the order of `first`
/// @throws std::invalid_argument if the numbers of channels differ.
std::vector<ModePair> pair_modes(const std::vector<ModeShape>& first,
                                 const std::vector<ModeShape>& second);

}  // namespace stageid
