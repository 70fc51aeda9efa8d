#include "hal/can/can_c_header.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/hal/can/can_rig.hpp"

namespace stageid::test_can_c_header {

using testing::HasSubstr;

// That it compiles and that a node works with it: tests/integration/zeromq_test.py.
TEST(CanCHeader, HasTheChannelsAndTheFingerprint) {
  test::CanRig rig;
  const std::string text =
      can_c_header(rig.layout(), rig.stage_spec().info, rig.stage_spec().limits);
  EXPECT_THAT(text, HasSubstr(fmt::format("FINGERPRINT 0x{:08x}u\n", rig.layout().fingerprint)));
  EXPECT_THAT(text, HasSubstr("#define STAGEID_ACTUATORS 2\n#define STAGEID_SENSORS 1\n"));
  EXPECT_THAT(text, HasSubstr("/* a2 [N] */ \"a2\""));
  EXPECT_THAT(text, HasSubstr("#define STAGEID_PROTOCOL_VERSION 2\n"));
}

TEST(CanCHeader, AMissingLimitIsInfinite) {
  test::CanRig rig;
  StageLimits limits = rig.stage_spec().limits;
  limits.position_window_m[0] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(can_c_header(rig.layout(), rig.stage_spec().info, limits),
              HasSubstr("/* s1 [m] */ HUGE_VAL }"));
}

}  // namespace stageid::test_can_c_header
