#include "hal/modbus/modbus_request_frame.hpp"

#include <gtest/gtest.h>

#include <string_view>

namespace stageid::test_modbus_request_frame {

using Bytes = std::vector<std::uint8_t>;

// The check value of CRC-16/MODBUS in every catalogue, and the example of the serial line guide's
// implementation notes: 02 07 -> 41 12 on the line.
TEST(ModbusRequestFrame, TheCrcIsTheStandardOne) {
  constexpr std::string_view kCheck = "123456789";
  EXPECT_EQ(modbus_crc16(Bytes(kCheck.begin(), kCheck.end())), 0x4B37);
  EXPECT_EQ(modbus_crc16(Bytes{0x02, 0x07}), 0x1241);
}

TEST(ModbusRequestFrame, ATcpRequestIsFoundOnceItIsWhole) {
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

TEST(ModbusRequestFrame, AnotherProtocolOrAnImpossibleLengthIsBroken) {
  EXPECT_EQ(parse_tcp_request(Bytes{0, 1, 0, 1, 0, 6, 1}).status, FrameStatus::broken);
  EXPECT_EQ(parse_tcp_request(Bytes{0, 1, 0, 0, 0, 1, 1}).status, FrameStatus::broken);
  EXPECT_EQ(parse_tcp_request(Bytes{0, 1, 0, 0, 0, 255, 1}).status, FrameStatus::broken);
  EXPECT_EQ(parse_tcp_request(Bytes{'G', 'E', 'T', ' ', '/', ' ', 'H'}).status,
            FrameStatus::broken);
}

TEST(ModbusRequestFrame, AnRtuRequestEndsWhereItsFunctionSays) {
  const Bytes read = rtu_frame(7, Bytes{3, 0, 200, 0, 2});
  const Bytes write = rtu_frame(7, Bytes{16, 0, 0, 0, 1, 2, 0xAB, 0xCD});
  const Bytes both = rtu_frame(7, Bytes{23, 0, 200, 0, 2, 0, 0, 0, 1, 2, 0xAB, 0xCD});
  for (const Bytes& whole : {read, write, both}) {
    Bytes line = whole;
    line.insert(line.end(), read.begin(), read.end());  // the following bytes are not taken
    for (std::size_t size = 0; size < whole.size(); ++size)
      EXPECT_EQ(parse_rtu_request(std::span(line).first(size)).status, FrameStatus::incomplete);
    const ModbusRequest found = parse_rtu_request(line);
    EXPECT_EQ(found.status, FrameStatus::complete);
    EXPECT_EQ(found.bytes, whole.size());
    EXPECT_EQ(found.unit, 7);
    EXPECT_EQ(rtu_frame(found.unit, found.pdu), whole);
  }
}

TEST(ModbusRequestFrame, OneFlippedBitBreaksAnRtuRequest) {
  const Bytes sound = rtu_frame(1, Bytes{3, 0, 200, 0, 2});
  for (std::size_t bit = 0; bit < 8 * sound.size(); ++bit) {
    if (bit / 8 == 1) continue;  // the function may change the length
    Bytes spoilt = sound;
    spoilt[bit / 8] = static_cast<std::uint8_t>(spoilt[bit / 8] ^ (1U << (bit % 8)));
    EXPECT_EQ(parse_rtu_request(spoilt).status, FrameStatus::broken) << bit;
  }
}

Bytes joined(const std::vector<Bytes>& pieces) {
  Bytes all;
  for (const Bytes& piece : pieces) all.insert(all.end(), piece.begin(), piece.end());
  return all;
}

TEST(ModbusRequestFrame, OurRequestIsFoundBetweenWhatOthersSay) {
  const Bytes ours = rtu_frame(1, Bytes{3, 0, 200, 0, 2});
  const Bytes asked = rtu_frame(2, Bytes{3, 0, 0, 0, 4});
  const Bytes told = rtu_frame(2, Bytes{3, 8, 1, 3, 0, 200, 0, 2, 1, 16});
  const Bytes noise = {1, 3, 0, 7, 2, 16, 9};
  for (const Bytes& before : {Bytes{}, asked, told, joined({asked, told}), joined({noise, told}),
                              joined({told, noise, asked})}) {
    const Bytes line = joined({before, ours, asked});
    const ModbusRequest found = find_rtu_request(line, 1);
    ASSERT_EQ(found.status, FrameStatus::complete) << before.size();
    EXPECT_EQ(found.bytes, before.size() + ours.size());
    EXPECT_EQ(rtu_frame(found.unit, found.pdu), ours);
  }
}

TEST(ModbusRequestFrame, OnlyWhatMayBecomeARequestIsKept) {
  const Bytes told = rtu_frame(2, Bytes{3, 8, 1, 3, 0, 200, 0, 2, 1, 16});
  const Bytes ours = rtu_frame(1, Bytes{3, 0, 200, 0, 2});
  const Bytes begun = joined({told, Bytes(ours.begin(), ours.begin() + 5)});
  const ModbusRequest found = find_rtu_request(begun, 1);
  EXPECT_EQ(found.status, FrameStatus::incomplete);
  EXPECT_EQ(found.bytes, told.size());
  EXPECT_EQ(find_rtu_request(told, 1).bytes, told.size());
}

}  // namespace stageid::test_modbus_request_frame
