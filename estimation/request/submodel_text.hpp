#pragma once

#include <string>
#include <string_view>

#include "estimation/model/submodel_request.hpp"

namespace stageid {

/// A submodel as in `--submodel`: comma-separated `key=value` pairs,
///   l=0  integrators        n=4 or n=auto  order        m=3  degree of the numerator
///   f=120:180  start frequencies of its poles, Hz       zeta=0.01 or zeta=0.01:0.02  their damping ratios
/// Default of l: 0; of m: n + l - 1 (strictly proper).
/// @throws std::invalid_argument naming the flag, the problem and the remedy
SubmodelRequest parse_submodel(std::string_view text);

/// The submodel in the same format, with every key.
std::string submodel_text(const SubmodelRequest& request);

/// The default degree of the numerator: the largest that is strictly proper.
int strictly_proper_degree(const SubmodelRequest& request);

}  // namespace stageid
