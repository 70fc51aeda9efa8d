#include "hal/can/can_dbc.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <linux/can/error.h>

#include "hal/can/can_socket.hpp"
#include "hal/can/can_transport.hpp"
#include "tests/hal/can/can_rig.hpp"

namespace stageid::test_can_dbc {

// Against the format itself: tests/vm/can_kernel_test.py reads recorded frames with this file alone.
TEST(CanDbc, NamesEveryFrameAndChannel) {
  test::CanRig rig(test::CanRigOptions{{}, {}, 2});
  const std::string text = can_dbc(rig.layout(), rig.stage_spec().info);
  EXPECT_THAT(text, testing::HasSubstr("BO_ 256 setpoint_0: 12 host"));
  EXPECT_THAT(text, testing::HasSubstr("BO_ 257 setpoint_1: 12 host"));
  EXPECT_THAT(text, testing::HasSubstr(
                        " SG_ a2 : 64|24@1- (7.4505805969238281e-06,0) [-62.4999925|62.4999925] "
                        "\"N\" node"));
  EXPECT_THAT(text, testing::HasSubstr("BO_ 384 measurement_0: 12 node"));
  EXPECT_THAT(text, testing::HasSubstr("BO_ 512 state: 48 node"));
  EXPECT_THAT(text, testing::HasSubstr("BO_ 128 command: 48 host"));
  EXPECT_THAT(text, testing::HasSubstr("BA_ \"VFrameFormat\" BO_ 897 14;"));
  EXPECT_THAT(text, testing::HasSubstr("8 \"fault\""));
}

TEST(SocketCan, ReadsErrorFramesAsTheKernelMeansThem) {
  using State = CanBusState;
  const auto after = [](State before, unsigned class_bits, unsigned controller) {
    return can_state_after_error(before, class_bits, static_cast<std::uint8_t>(controller));
  };
  EXPECT_EQ(after(State::active, CAN_ERR_BUSOFF, 0), State::off);
  EXPECT_EQ(after(State::off, CAN_ERR_RESTARTED, 0), State::active);
  EXPECT_EQ(after(State::active, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE), State::passive);
  EXPECT_EQ(after(State::active, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE), State::passive);
  EXPECT_EQ(after(State::active, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING), State::warning);
  EXPECT_EQ(after(State::passive, CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE), State::active);
  EXPECT_EQ(after(State::passive, CAN_ERR_ACK, 0), State::passive);
  EXPECT_EQ(after(State::warning, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW), State::warning);
}

TEST(SocketCan, RefusesInterfacesThatAreNotThere) {
  EXPECT_THROW(SocketCan({}, {}), StageError);
  // Without CAN in the kernel the socket fails, with it the name.
  EXPECT_THROW(SocketCan({"no-such-can"}, {}), StageError);
}

TEST(CanTransport, TheWorstBusCounts) {
  test::CanPair pair({"one", "two", "three"});
  EXPECT_EQ(worst_bus(pair.host()).state, CanBusState::active);
  pair.set_state(1, CanBusState::passive);
  pair.set_state(2, CanBusState::warning);
  EXPECT_EQ(worst_bus(pair.host()).state, CanBusState::passive);
  EXPECT_EQ(worst_bus(pair.host()).bus, 1U);
  EXPECT_STREQ(to_string(CanBusState::down), "interface down");
}

}  // namespace stageid::test_can_dbc
