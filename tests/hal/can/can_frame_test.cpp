#include "hal/can/can_frame.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string_view>
#include <utility>

#include "hal/can/can_encoding.hpp"
#include "hal/can/can_layout.hpp"
#include "tests/hal/can/can_rig.hpp"

namespace stageid::test_can_frame {

CanFrame sealed(std::size_t payload_bytes) {
  CanFrame frame;
  frame.id = 0x123;
  for (std::size_t i = 0; i < payload_bytes; ++i)
    frame.data[kCanHeaderBytes + i] = static_cast<std::uint8_t>(7 * i + 1);
  seal_can_frame(frame, {0xBEEF, 0x5A, 0x11, 0xCAFE}, payload_bytes);
  return frame;
}

TEST(CanFrame, HasTheLengthsOfCanFd) {
  for (std::size_t bytes = 0; bytes <= 8; ++bytes) EXPECT_EQ(can_fd_length(bytes), bytes);
  const std::pair<std::size_t, std::size_t> longer[] = {{9, 12},  {13, 16}, {17, 20}, {24, 24},
                                                        {25, 32}, {33, 48}, {49, 64}, {64, 64}};
  for (const auto& [bytes, length] : longer) EXPECT_EQ(can_fd_length(bytes), length);
}

// The CRC's published check value: "123456789" gives 0x29B1 (CRC RevEng catalogue, CRC-16/IBM-3740).
TEST(CanFrame, CrcAgreesWithTheCatalogue) {
  // Identifier and bytes in the order of the check string; bytes 6 and 7 are not in the CRC.
  constexpr std::string_view kText = "123456789";
  CanFrame frame;
  frame.id = static_cast<std::uint16_t>(kText[0] | kText[1] << 8);
  frame.length = 9;
  for (std::size_t i = 0; i < 6; ++i) frame.data[i] = static_cast<std::uint8_t>(kText[i + 2]);
  frame.data[6] = frame.data[7] = 0xFF;
  frame.data[8] = static_cast<std::uint8_t>(kText[8]);
  EXPECT_EQ(can_frame_crc(frame), 0x29B1);
}

// A CRC of 16 bits finds every single and double error of 520 bits (period of the polynomial 32767).
TEST(CanFrame, EveryErrorOfOneOrTwoBitsIsFound) {
  const CanFrame good = sealed(56);
  CanHeader header;
  ASSERT_TRUE(open_can_frame(good, 56, header));
  EXPECT_FALSE(open_can_frame(good, 30, header)) << "another length";
  const auto flip = [](CanFrame& frame, std::size_t bit) {
    if (bit < 512) {
      frame.data[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    } else {
      frame.id ^= static_cast<std::uint16_t>(1U << (bit - 512));
    }
  };
  for (std::size_t first = 0; first < 523; ++first) {
    CanFrame one = good;
    flip(one, first);
    ASSERT_FALSE(open_can_frame(one, 56, header)) << first;
    for (std::size_t second = first + 1; second < 523; second += 13) {
      CanFrame two = one;
      flip(two, second);
      ASSERT_FALSE(open_can_frame(two, 56, header)) << first << " and " << second;
    }
  }
}

TEST(CanFrame, ValuesAreRoundedToHalfACount) {
  const CanScale scale{62.5 / kCanCountsOfRange};
  CanFrame frame;
  for (double value = -62.4; value < 62.4; value += 0.137) {
    ASSERT_EQ(put_can_value(frame, 8, value, scale), CanConversion::good);
    ASSERT_NEAR(get_can_value(frame, 8, scale), value, 0.5 * scale.si_per_count * (1 + 1e-9));
  }
}

TEST(CanFrame, WhatDoesNotFitSaturatesAndSaysSo) {
  const CanScale scale{1.0 / kCanCountsOfRange};
  CanFrame frame;
  EXPECT_EQ(put_can_value(frame, 8, 2.0, scale), CanConversion::saturated);
  EXPECT_EQ(get_can_value(frame, 8, scale), kCanLargestCount * scale.si_per_count);
  EXPECT_EQ(put_can_value(frame, 8, -2.0, scale), CanConversion::saturated);
  EXPECT_EQ(get_can_value(frame, 8, scale), -kCanLargestCount * scale.si_per_count);
  EXPECT_EQ(put_can_value(frame, 8, kCanLargestCount * scale.si_per_count, scale),
            CanConversion::good);
}

TEST(CanFrame, WhatIsNoNumberComesAsNoValue) {
  const CanScale scale{1.0};
  CanFrame frame;
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(put_can_value(frame, 8, value, scale), CanConversion::no_number);
    EXPECT_TRUE(std::isnan(get_can_value(frame, 8, scale)));
  }
}

TEST(CanLayout, SpreadsOverBusesAndFrames) {
  const StageInfo info = test::silent_wafer_stage_spec().info;
  CanSpec spec = test::one_bus_spec(info);
  spec.buses.push_back({"can1", 1e6, 5e6, {16, 3}, {}});
  std::erase(spec.buses[0].actuators, 16);
  std::erase(spec.buses[0].actuators, 3);
  const CanLayout layout = can_layout(spec, info);
  ASSERT_EQ(layout.setpoints.size(), 2U);
  EXPECT_EQ(layout.setpoints[1].id, 0x101);
  EXPECT_EQ(layout.setpoints[1].bus, 1);
  EXPECT_EQ(layout.setpoints[1].channels, (std::vector<std::size_t>{16, 3}));
  EXPECT_EQ(can_host_identifiers(layout).size(), 5U);
  EXPECT_EQ(can_node_identifiers(layout).size(), 4U);
}

TEST(CanLayout, TheFingerprintTellsWhatBothSidesMustAgreeOn) {
  const StageInfo info = test::silent_wafer_stage_spec().info;
  const CanSpec spec = test::one_bus_spec(info);
  const std::uint32_t fingerprint = can_layout(spec, info).fingerprint;
  const auto differs = [&](void (*change)(CanSpec&, StageInfo&)) {
    CanSpec other = spec;
    StageInfo other_info = info;
    change(other, other_info);
    return can_layout(other, other_info).fingerprint != fingerprint;
  };
  EXPECT_FALSE(differs([](CanSpec& s, StageInfo&) { s.buses[0].interface = "vcan7"; }));
  EXPECT_TRUE(differs([](CanSpec& s, StageInfo&) { s.actuator_range_n[3] = 60.0; }));
  EXPECT_TRUE(differs(
      [](CanSpec& s, StageInfo&) { std::swap(s.buses[0].sensors[0], s.buses[0].sensors[1]); }));
  EXPECT_TRUE(differs([](CanSpec&, StageInfo& i) { i.sample_rate_hz = 5e3; }));
  EXPECT_TRUE(differs([](CanSpec&, StageInfo& i) { i.sensors[0].name = "other"; }));
}

TEST(CanLayout, RefusesWhatMakesNoSense) {
  const StageInfo info = test::silent_wafer_stage_spec().info;
  const auto refused = [&](void (*change)(CanSpec&)) {
    CanSpec spec = test::one_bus_spec(info);
    change(spec);
    EXPECT_THROW(can_layout(spec, info), std::invalid_argument);
  };
  refused([](CanSpec& s) { s.buses.clear(); });
  refused([](CanSpec& s) { s.buses[0].interface.clear(); });
  refused([](CanSpec& s) { s.buses.push_back({"can0", 1e6, 5e6, {}, {}}); });
  refused([](CanSpec& s) { s.buses[0].data_bit_rate_hz = 0.0; });
  refused([](CanSpec& s) { s.buses[0].actuators.pop_back(); });
  refused([](CanSpec& s) { s.buses[0].actuators.push_back(0); });
  refused([](CanSpec& s) { s.buses[0].sensors.push_back(7); });
  refused([](CanSpec& s) { s.actuator_range_n.pop_back(); });
  refused([](CanSpec& s) { s.sensor_range_m[2] = -1.0; });
  refused([](CanSpec& s) { s.reply_timeout_s = 0.0; });
  refused([](CanSpec& s) { s.watchdog_s = 0.0; });
  refused([](CanSpec& s) { s.largest_load = 1.5; });
}

TEST(CanMessages, CommandsStatesAndTransfersComeBack) {
  CanCommand command{CanCommandCode::arm, 77,         1ULL << 60, 1234567, 99,
                     0xDEADBEEF,          0xCAFE0003, 0xA1B2C3};
  CanCommand back;
  ASSERT_TRUE(decode_can_command(encode_can_command(command), back));
  EXPECT_EQ(back, command);
  EXPECT_EQ(back.version, kCanProtocolVersion);

  CanState state;
  state.state = NodeState::fault;
  state.cause = FaultCause::limit;
  state.answer = CanAnswer::refused;
  state.resident = CanResident::playing;
  state.gaps = 1;
  state.repeated = 2;
  state.rejected = 3;
  state.sample = 1ULL << 40;
  state.fingerprint = 0x12345678;
  state.boot = 0xB007;
  state.host = 0xCAFE0003;
  state.session = 0xA1B2C3;
  CanState told;
  ASSERT_TRUE(decode_can_state(encode_can_state(state), told));
  EXPECT_EQ(told, state);

  const std::vector<std::uint8_t> bytes{1, 2, 3, 250};
  CanChunk chunk;
  const CanFrame frame = encode_can_chunk(kCanUploadId, {0xABCDEF, 9, bytes});
  ASSERT_TRUE(decode_can_chunk(frame, chunk));
  EXPECT_EQ(chunk.index, 0xABCDEFU);
  EXPECT_EQ(chunk.token, 9);
  EXPECT_EQ(std::vector<std::uint8_t>(chunk.bytes.begin(), chunk.bytes.end()), bytes);

  CanMissing missing;
  missing.first = 0x123456;
  missing.token = 4;
  missing.received[47] = 0x81;
  CanMissing seen;
  ASSERT_TRUE(decode_can_missing(encode_can_missing(missing), seen));
  EXPECT_EQ(seen.first, missing.first);
  EXPECT_EQ(seen.token, 4);
  EXPECT_EQ(seen.received, missing.received);
}

TEST(CanMessages, ATextComesInParts) {
  const std::string text = "actuator a1: |u| would be 12.4 N, limit 10 N (cycle 40123), and more";
  std::string back;
  for (std::size_t part = 0; part < kCanTextParts; ++part) {
    std::size_t number = 0;
    std::string piece;
    ASSERT_TRUE(decode_can_text(encode_can_text(text, part, 1), number, piece));
    EXPECT_EQ(number, part);
    back += piece;
  }
  EXPECT_EQ(back, text);
}

TEST(CanMessages, WhatIsOutOfRangeIsRefusedThoughItsCrcIsRight) {
  const auto with_byte = [](CanFrame frame, std::size_t at, std::uint8_t value) {
    frame.data[at] = value;
    put_can(frame, 6, can_frame_crc(frame));
    return frame;
  };
  // Unknown codes of a state are passed on; PeerStatus defines their meaning.
  CanState state;
  ASSERT_TRUE(decode_can_state(with_byte(encode_can_state({}), 2, 9), state));
  EXPECT_GT(state.state, NodeState::fault);
  CanCommand command;
  for (const int code : {0, 6, 15, 21, 255})
    EXPECT_FALSE(decode_can_command(
        with_byte(encode_can_command({}), 2, static_cast<std::uint8_t>(code)), command))
        << code;
  CanChunk chunk;
  EXPECT_FALSE(decode_can_chunk(with_byte(encode_can_chunk(kCanUploadId, {}), 4, 57), chunk));
  std::size_t part = 0;
  std::string piece;
  EXPECT_FALSE(decode_can_text(with_byte(encode_can_text("x", 0, 0), 4, 3), part, piece));
}

}  // namespace stageid::test_can_frame
