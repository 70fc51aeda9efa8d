#include "hal/modbus/modbus_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <utility>

namespace stageid::modbus_map {
namespace test_modbus_map {

TEST(ModbusMap, EntriesLieInOrderWithoutOverlap) {
  int end = 0;
  for (const Entry& entry : entries()) {
    EXPECT_GE(entry.address, end) << entry.name;
    end = entry.address + entry.registers();
    EXPECT_EQ(entry.access == Access::write, entry.address < kWritableEnd) << entry.name;
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

TEST(ModbusMap, TheDocumentHoldsTheTable) {
  const std::ifstream file(STAGEID_SOURCE_DIR "/docs/modbus-map.md");
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_THAT(text.str(), testing::HasSubstr(markdown_table()));
}

Channel channel(std::string name, std::string unit) {
  Channel c;
  c.name = std::move(name);
  c.unit = std::move(unit);
  return c;
}

// Computed with Python: h = 0x811C9DC5; for b in b"a1 N\na2 N\ns1 m\n": h = (h ^ b) * 0x01000193 % 2**32
TEST(ModbusMap, TheChannelHashIsFnv1aOfNamesAndUnits) {
  StageInfo info;
  EXPECT_EQ(channel_hash(info), 0x811C9DC5U);
  info.actuators = {channel("a1", "N"), channel("a2", "N")};
  info.sensors = {channel("s1", "m")};
  EXPECT_EQ(channel_hash(info), 0x8C02120DU);
  std::swap(info.actuators[0], info.actuators[1]);
  EXPECT_NE(channel_hash(info), 0x8C02120DU);
}

}  // namespace test_modbus_map
}  // namespace stageid::modbus_map
