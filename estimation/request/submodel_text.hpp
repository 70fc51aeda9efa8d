#pragma once

#include <string>
#include <string_view>

#include "estimation/model/submodel_request.hpp"

namespace stageid {

/// A submodel as `--submodel` takes it: `key=value` pairs with commas between them,
///   l=0  integrators        n=4 or n=auto  order        m=3  degree of the numerator
///   f=120:180  Hz, where its poles start        zeta=0.01 or zeta=0.01:0.02  their damping ratios
/// l is 0 unless given, m what makes it strictly proper, n + l - 1.
/// @throws std::invalid_argument naming the flag, what is wrong and what would be right
SubmodelRequest parse_submodel(std::string_view text);

/// The same submodel in the same words, every key filled in.
std::string submodel_text(const SubmodelRequest& request);

/// The degree of the numerator where none is given: the largest that is strictly proper.
int strictly_proper_degree(const SubmodelRequest& request);

}  // namespace stageid
