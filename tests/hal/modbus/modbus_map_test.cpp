#include "hal/modbus/modbus_map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "tests/support/process/file_bytes.hpp"

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
  EXPECT_THAT(test::bytes_of(STAGEID_SOURCE_DIR "/docs/modbus-map.md"),
              testing::HasSubstr(markdown_table()));
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
