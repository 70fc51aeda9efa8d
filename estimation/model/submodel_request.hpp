#pragma once

#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/model/basis.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A requested submodel of the general additive structure:
///   P_i = (B_0 + B_1 s + ... + B_m s^m) / (s^l (1 + a_1 s + ... + a_n s^n)).
struct SubmodelRequest {
  SubmodelShape shape;
  bool order_by_search = false;  ///< n = 2 K, m = n - 1, K the number of modes found by a search
  /// Start frequencies of its poles: of floor(n/2) conjugate pairs, then of one real pole if n is odd. Empty: at modes
  /// that are found; a real pole starts where the cost is smallest.
  std::vector<double> frequency_hz;
  std::vector<double> damping_ratio;  ///< of the pairs: one each, one for all, or empty: 0.01

  int pairs() const noexcept { return shape.order / 2; }
  bool has_real_pole() const noexcept { return shape.order % 2 == 1; }
  bool has_start() const noexcept {
    return !order_by_search && (shape.order == 0 || !frequency_hz.empty());
  }
  bool biproper() const noexcept {
    return !order_by_search && shape.numerator_degree == shape.order + shape.integrators;
  }
};

/// Beyond this order, the normal equations in the coefficients of one denominator lose their digits. On noise-free
/// data of modes over a decade with damping ratios of 0.01, order 16 is accurate to 1e-12, order 20 to 3e-11 with
/// standard deviations that are rounding errors, and order 24 does not converge.
inline constexpr int kLargestOrder = 16;

/// Checks a single request. @returns the problem and its remedy; empty: valid
std::string fault_of(const SubmodelRequest& request);

/// Checks requests together with the submodels besides them: at most one with integrators (including a rigid body), at
/// most one biproper (including a direct term). @returns as above
std::string fault_of(const std::vector<SubmodelRequest>& requests, bool rigid_body,
                     bool direct_term);

/// The submodel as start of a fit, numerators zero. @pre request.has_start(), fault_of() is empty
Submodel start_submodel(const FrfEstimate& frf, const SubmodelRequest& request);

}  // namespace stageid
