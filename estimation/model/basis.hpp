#pragma once

#include <Eigen/Core>
#include <complex>
#include <map>
#include <vector>

#include "estimation/model/hold_equivalent.hpp"

namespace stageid {

/// The rational functions s^m / (s^l A(s)) of a submodel, A of order n, m = 0 .. degree.
struct SubmodelShape {
  int integrators = 0;       ///< l, 0 to 2
  int order = 0;             ///< n
  int numerator_degree = 0;  ///< m
  int functions() const noexcept { return numerator_degree + 1; }
};
SubmodelShape shape_of(const Submodel& submodel);

/// The functions of frequency of one submodel on the lines, through hold, delay and sampler.
struct SubmodelBasis {
  SplitMatrix value;     ///< N x (m+1):  H{ s^p / (s^l A) }
  SplitMatrix gradient;  ///< N x (m+1) n: its derivative to a_q in column p n + (q-1)
  SplitMatrix delay;     ///< N x (m+1): its derivative to the delay
};

/// Parts of a SubmodelBasis to compute besides the value; the rest remains empty.
struct WantedBasis {
  bool gradient = false;
  bool delay = false;
};

/// Channels c = output + n_y input that share one delay, of `count` channels from `first` on.
/// @param input_s, output_s may be empty: 0
std::map<double, std::vector<Eigen::Index>> channels_by_delay(const Eigen::VectorXd& input_s,
                                                              const Eigen::VectorXd& output_s,
                                                              Eigen::Index outputs,
                                                              Eigen::Index first,
                                                              Eigen::Index count);

/// The poles of A(s) = 1 + a_1 s + ... + a_n s^n.
std::vector<std::complex<double>> roots(const Eigen::Ref<const Eigen::VectorXd>& a);

/// Evaluates the functions of one submodel with denominator coefficients a (size n): each is written in
/// partial fractions, and `through` acts on every fraction in closed form.
/// @pre the poles are simple and not zero; the function is proper.
void evaluate_basis(const HoldEquivalent& through, const SubmodelShape& shape,
                    const Eigen::Ref<const Eigen::VectorXd>& a, WantedBasis wanted,
                    SubmodelBasis& out);

}  // namespace stageid
