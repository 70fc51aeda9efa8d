#pragma once

#include "estimation/problem/fit_options.hpp"

namespace stageid::test {

/// For a stage behind a hold and 0.137 ms, the delay estimated from there.
inline FitOptions options_with(Weighting weighting) {
  FitOptions options;
  options.weighting = weighting;
  options.hold = HoldModel::exact;
  options.delay = DelayModel::estimate;
  options.delay_s = 1.37e-4;
  return options;
}

}  // namespace stageid::test
