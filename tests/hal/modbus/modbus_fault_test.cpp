#include "hal/modbus/modbus_fault.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace stageid::test_modbus_fault {

using Kind = ModbusFault::Kind;

TEST(ModbusFault, ReadsWhatIsAskedFor) {
  const ModbusFault late = parse_modbus_fault("late_reply@200:0.4");
  EXPECT_EQ(late.kind, Kind::late_reply);
  EXPECT_EQ(late.from, 200U);
  EXPECT_EQ(late.count, 1U);
  EXPECT_EQ(late.value, 0.4);
  const ModbusFault refused = parse_modbus_fault("exception@50x3:4");
  EXPECT_EQ(refused.kind, Kind::exception);
  EXPECT_EQ(refused.count, 3U);
  EXPECT_EQ(parse_modbus_fault("half_frame").from, 1U);
  EXPECT_EQ(parse_modbus_fault("interlock@7").count, 0U) << "lasts";
  EXPECT_EQ(parse_modbus_fault("gravity@7:-3.5").value, -3.5);
}

TEST(ModbusFault, RefusesEverythingElseWithTheForm) {
  for (const char* text :
       {"", "late", "late_reply", "late_reply@x:1", "late_reply@:1", "half_frame@x3",
        "late_reply@0:1", "late_reply:0", "late_reply:61", "late_reply:nan", "half_frame:1",
        "exception:0", "exception:12", "exception@5xtwo:4", "interlock:1", "temperature",
        "temperature:inf", "gravity:1N"}) {
    try {
      static_cast<void>(parse_modbus_fault(text));
      ADD_FAILURE() << "'" << text << "' was taken";
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), testing::HasSubstr("KIND[@REQUEST][xCOUNT][:VALUE]")) << text;
    }
  }
}

TEST(ModbusFault, IsOnForItsRequests) {
  ModbusFaultScript script(
      {parse_modbus_fault("half_frame@2x2"), parse_modbus_fault("interlock@3")});
  std::vector<bool> half;
  std::vector<bool> open;
  for (int request = 1; request <= 5; ++request) {
    script.next_request();
    half.push_back(script.active(Kind::half_frame) != nullptr);
    open.push_back(script.active(Kind::interlock) != nullptr);
  }
  EXPECT_EQ(half, (std::vector<bool>{false, true, true, false, false}));
  EXPECT_EQ(open, (std::vector<bool>{false, false, true, true, true}));
  EXPECT_TRUE(script.mentions(Kind::interlock));
  EXPECT_FALSE(script.mentions(Kind::gravity));
}

}  // namespace stageid::test_modbus_fault
