#pragma once

#include "hal/stage/real_time.hpp"
#include "tools/config/config_visitor.hpp"

namespace stageid {

/// The group `realtime` of a stage file.
struct RealTimeKeys {
  RealTimeOptions options;
  double jitter_s = 0.0;    ///< 0: tolerable_jitter_s()
  int misses_allowed = 10;  ///< see LoopOptions
};

void describe_real_time(ConfigVisitor& visitor, RealTimeKeys& keys);

}  // namespace stageid
