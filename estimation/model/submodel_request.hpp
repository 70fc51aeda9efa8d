#pragma once

#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/model/basis.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// A submodel of the general additive structure as it is asked for:
///   P_i = (B_0 + B_1 s + ... + B_m s^m) / (s^l (1 + a_1 s + ... + a_n s^n)).
struct SubmodelRequest {
  SubmodelShape shape;
  bool order_by_search = false;  ///< n = 2 K, m = n - 1, K the number of modes that a search finds
  /// Where its poles start: of floor(n/2) conjugate pairs, and last, if n is odd, of one real pole.
  /// Empty: where modes are found, and for a real pole where the cost is least.
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

/// Beyond, normal equations in the coefficients of one denominator lose their digits: order 16 gives
/// back noise-free data of eight modes to 1e-12, order 20 to 3e-11 and its standard deviations are
/// rounding, order 24 does not converge (modes over a decade, damping ratios of 0.01).
inline constexpr int kLargestOrder = 16;

/// One request for itself. @returns what is wrong and what would be right, or nothing
std::string fault_of(const SubmodelRequest& request);

/// Requests together, and with the submodels beside them: at most one with integrators (a rigid body is
/// one), at most one biproper (a direct term is one). @returns as above
std::string fault_of(const std::vector<SubmodelRequest>& requests, bool rigid_body,
                     bool direct_term);

/// As a start of a fit, numerators zero. @pre request.has_start(), fault_of() is empty
Submodel start_submodel(const FrfEstimate& frf, const SubmodelRequest& request);

}  // namespace stageid
