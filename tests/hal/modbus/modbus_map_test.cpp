#include "hal/modbus/modbus_map.hpp"

#include <gtest/gtest.h>

#include <iterator>
#include <string>
#include <utility>

#include "tests/support/process/docs_table.hpp"

namespace stageid::modbus_map {
namespace test_modbus_map {

constexpr std::pair<const char*, int> kAddresses[] = {
    {"heartbeat", kHeartbeat},
    {"command", kCommand},
    {"command_sequence", kCommandSequence},
    {"run_command", kRunCommand},
    {"run_sequence", kRunSequence},
    {"run_seed", kRunSeed},
    {"run_key", kRunKey},
    {"setpoint_sequence", kSetpointSequence},
    {"setpoint[56]", kSetpoint},
    {"magic", kMagic},
    {"map_version", kVersion},
    {"boot_id", kBootId},
    {"heartbeat_echo", kHeartbeatEcho},
    {"state", kState},
    {"cause", kCause},
    {"flags", kFlags},
    {"command_echo", kCommandEcho},
    {"command_reply", kCommandReply},
    {"gravity_compensators", kGravityCount},
    {"temperatures", kTemperatureCount},
    {"gravity_compensator[8]", kGravity},
    {"temperature[8]", kTemperature},
    {"measurement_boot_id", kMeasurementBootId},
    {"measurement_sequence", kMeasurementSequence},
    {"session", kSession},
    {"measurement_status", kMeasurementStatus},
    {"valid", kValid},
    {"measurement[56]", kMeasurement},
    {"actuators", kActuatorCount},
    {"sensors", kSensorCount},
    {"sample_rate", kSampleRate},
    {"channel_hash", kChannelHash},
    {"actuator_scale[56]", kActuatorScale},
    {"sensor_scale[56]", kSensorScale}};

TEST(ModbusMap, TheDocumentHasItsAddressesInOrderWithoutOverlap) {
  const auto rows = test::table_in_docs("modbus-map.md", "| address | registers | name |");
  ASSERT_EQ(rows.size(), std::size(kAddresses));
  int end = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& [name, address] = kAddresses[i];
    EXPECT_EQ(rows[i][0], std::to_string(address)) << name;
    EXPECT_EQ(rows[i][2], name);
    EXPECT_EQ(rows[i][5], address < kWritableEnd ? "read, write" : "read") << name;
    EXPECT_GE(address, end) << name;
    end = address + std::stoi(rows[i][1]);
  }
  EXPECT_EQ(end, kEnd);
}

// Limits of the protocol: 121 registers written and 125 read by a function 23.
TEST(ModbusMap, OneTransactionCarriesEveryBlock) {
  EXPECT_LE(kWritableEnd - kRunKey, 121);
  EXPECT_LE(kMeasurement + 2 * kMostChannels - kMeasurementBootId, 125);
  EXPECT_LE(kStatusRegisters, 125);
  EXPECT_EQ(kRunKey + 2 - kRunCommand, kRunRegisters);
  EXPECT_EQ(kCommandSequence + 2 - kHeartbeat, kSupervisorRegisters);
}

// Computed with Python: h = 0x811C9DC5; for b in b"a1 N\na2 N\ns1 m\n": h = (h ^ b) * 0x01000193 % 2**32
TEST(ModbusMap, TheChannelHashIsFnv1aOfNamesAndUnits) {
  StageInfo info;
  EXPECT_EQ(channel_hash(info), 0x811C9DC5U);
  info.actuators = {{.name = "a1", .unit = "N"}, {.name = "a2", .unit = "N"}};
  info.sensors = {{.name = "s1", .unit = "m"}};
  EXPECT_EQ(channel_hash(info), 0x8C02120DU);
  std::swap(info.actuators[0], info.actuators[1]);
  EXPECT_NE(channel_hash(info), 0x8C02120DU);
}

}  // namespace test_modbus_map
}  // namespace stageid::modbus_map
