#include "hal/modbus_frame.hpp"

#include <gtest/gtest.h>

#include <string_view>
#include <vector>

namespace stageid {
namespace {

using Bytes = std::vector<std::uint8_t>;

// The check value of CRC-16/MODBUS in every catalogue, and the example of the serial line guide's
// implementation notes: 02 07 -> 41 12 on the line.
TEST(ModbusFrame, TheCrcIsTheStandardOne) {
  constexpr std::string_view kCheck = "123456789";
  EXPECT_EQ(modbus_crc16(Bytes(kCheck.begin(), kCheck.end())), 0x4B37);
  EXPECT_EQ(modbus_crc16(Bytes{0x02, 0x07}), 0x1241);
}

TEST(ModbusFrame, ATcpRequestIsFoundOnceItIsWhole) {
  const Bytes request = {0x12, 0x34, 0, 0, 0, 6, 7, 3, 0, 200, 0, 2};
  for (std::size_t size = 0; size < request.size(); ++size)
    EXPECT_EQ(parse_tcp_request(std::span(request).first(size)).status, FrameStatus::incomplete);
  const ModbusRequest found = parse_tcp_request(request);
  EXPECT_EQ(found.status, FrameStatus::complete);
  EXPECT_EQ(found.bytes, 12U);
  EXPECT_EQ(found.transaction, 0x1234);
  EXPECT_EQ(found.unit, 7);
  EXPECT_EQ(Bytes(found.pdu.begin(), found.pdu.end()), (Bytes{3, 0, 200, 0, 2}));
  EXPECT_EQ(tcp_frame(0x1234, 7, found.pdu), request);
}

TEST(ModbusFrame, AnotherProtocolOrAnImpossibleLengthIsBroken) {
  EXPECT_EQ(parse_tcp_request(Bytes{0, 1, 0, 1, 0, 6, 1}).status, FrameStatus::broken);
  EXPECT_EQ(parse_tcp_request(Bytes{0, 1, 0, 0, 0, 1, 1}).status, FrameStatus::broken);
  EXPECT_EQ(parse_tcp_request(Bytes{0, 1, 0, 0, 0, 255, 1}).status, FrameStatus::broken);
  EXPECT_EQ(parse_tcp_request(Bytes{'G', 'E', 'T', ' ', '/', ' ', 'H'}).status,
            FrameStatus::broken);
}

TEST(ModbusFrame, AnRtuRequestEndsWhereItsFunctionSays) {
  const Bytes read = rtu_frame(7, Bytes{3, 0, 200, 0, 2});
  const Bytes write = rtu_frame(7, Bytes{16, 0, 0, 0, 1, 2, 0xAB, 0xCD});
  const Bytes both = rtu_frame(7, Bytes{23, 0, 200, 0, 2, 0, 0, 0, 1, 2, 0xAB, 0xCD});
  for (const Bytes& whole : {read, write, both}) {
    Bytes line = whole;
    line.insert(line.end(), read.begin(), read.end());  // what follows is not taken
    for (std::size_t size = 0; size < whole.size(); ++size)
      EXPECT_EQ(parse_rtu_request(std::span(line).first(size)).status, FrameStatus::incomplete);
    const ModbusRequest found = parse_rtu_request(line);
    EXPECT_EQ(found.status, FrameStatus::complete);
    EXPECT_EQ(found.bytes, whole.size());
    EXPECT_EQ(found.unit, 7);
    EXPECT_EQ(rtu_frame(found.unit, found.pdu), whole);
  }
}

TEST(ModbusFrame, OneFlippedBitBreaksAnRtuRequest) {
  const Bytes sound = rtu_frame(1, Bytes{3, 0, 200, 0, 2});
  for (std::size_t bit = 0; bit < 8 * sound.size(); ++bit) {
    if (bit / 8 == 1) continue;  // in the function it may change the length
    Bytes spoilt = sound;
    spoilt[bit / 8] = static_cast<std::uint8_t>(spoilt[bit / 8] ^ (1U << (bit % 8)));
    EXPECT_EQ(parse_rtu_request(spoilt).status, FrameStatus::broken) << bit;
  }
}

}  // namespace
}  // namespace stageid
