#pragma once

#include <functional>

#include "estimation/request/fit_request.hpp"

namespace stageid {

/// The first answer to an edit: poles at the given modes, delays of `before`, numerators that minimize the cost. Linear, so
/// it takes a small part of the time of a fit.
/// @param before null: none
/// @throws what fit_additive_model() throws
AdditiveModel warm_start(const FitSetup& setup, const AdditiveModel* before);

/// The second answer: poles, delays and numerators fitted from `start`, until they converge or enough() is true.
AdditiveModel improved(const FitSetup& setup, const AdditiveModel& start,
                       const std::function<bool()>& enough);

}  // namespace stageid
