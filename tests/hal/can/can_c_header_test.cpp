#include "hal/can/can_c_header.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/hal/can/can_rig.hpp"

namespace stageid::test_can_c_header {

// That it compiles and that a node works with it: tests/integration/zeromq_test.py.
TEST(CanCHeader, AMissingLimitIsInfinite) {
  test::CanRig rig;
  StageLimits limits = rig.stage_spec().limits;
  limits.position_window_m[0] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(can_c_header(rig.layout(), rig.stage_spec().info, limits),
              testing::HasSubstr("/* s1 [m] */ HUGE_VAL }"));
}

}  // namespace stageid::test_can_c_header
