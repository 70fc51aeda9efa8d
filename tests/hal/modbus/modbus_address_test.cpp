#include "hal/modbus/modbus_address.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hal/modbus/modbus_stage.hpp"

namespace stageid::test_modbus_address {

ModbusAddress serial(int baud) {
  ModbusAddress address;
  address.device = "/dev/null";
  address.baud = baud;
  return address;
}

double rate_hz(int baud) {
  ModbusTiming timing;
  timing.device_s = 0.0;
  return 1.0 / modbus_transaction_s(serial(baud), timing, 34, 14);
}

// 17 setpoints and 7 measurements of 32 bits: 81 + 33 bytes of 11 bits. By hand, 19200 baud:
// 1254 bits / 19200 + 2 x 38.5 bits / 19200 = 69.3 ms; 115200: 10.885 + 3.5 = 14.39 ms; 921600:
// 1.361 + 3.5 = 4.861 ms.
TEST(ModbusAddress, ASerialTransactionTakesItsBytesAndTwoSilences) {
  EXPECT_NEAR(rate_hz(19200), 1.0 / 69.32e-3, 0.01);
  EXPECT_NEAR(rate_hz(115200), 1.0 / 14.385e-3, 0.01);
  EXPECT_NEAR(rate_hz(921600), 1.0 / 4.8607e-3, 0.05);
}

TEST(ModbusAddress, OverTcpTheDeviceCounts) {
  ModbusTiming timing;
  timing.device_s = 0.004;
  EXPECT_EQ(modbus_transaction_s({}, timing, 100, 100), 0.004);
}

StageInfo info(double rate_hz, std::size_t actuators, std::size_t sensors) {
  StageInfo info;
  info.sample_rate_hz = rate_hz;
  info.actuators.resize(actuators);
  info.sensors.resize(sensors);
  return info;
}

auto making(const StageInfo& stage, const ModbusAddress& address) {
  return [=] { const ModbusStage made(stage, address, {}); };
}

auto refuses(const testing::Matcher<std::string>& text) {
  return testing::ThrowsMessage<std::invalid_argument>(text);
}

// One actuator and one sensor: 4 + 2 written, 12 + 2 read, 25 + 33 bytes: 638 bits / 19200 = 33.23 ms
// + 2 x 2.005 + 1 = 38.24 ms: 26 Hz.
TEST(ModbusStageRate, AFasterStageThanTheLinkIsRefusedWithTheFigures) {
  EXPECT_NO_THROW(making(info(26.0, 1, 1), serial(19200))());
  EXPECT_THAT(making(info(27.0, 1, 1), serial(19200)),
              refuses(testing::AllOf(testing::HasSubstr("27 Hz"),
                                     testing::HasSubstr("38.2 ms (25 + 33 bytes at 19200 baud)"),
                                     testing::HasSubstr("the maximum is 26 Hz"))));
}

TEST(ModbusStageRate, MoreChannelsThanOneTransactionAreRefused) {
  EXPECT_NO_THROW(making(info(10.0, 56, 56), {})());
  EXPECT_THAT(making(info(10.0, 57, 1), {}), refuses(testing::HasSubstr("57 actuators")));
  EXPECT_THAT(making(info(10.0, 1, 57), {}), refuses(testing::HasSubstr("57 sensors")));
}

}  // namespace stageid::test_modbus_address
