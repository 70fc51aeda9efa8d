#include "hal/modbus/modbus_answer.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <vector>

#include "tests/hal/modbus/numbered_registers.hpp"

namespace stageid::test_modbus_answer {

using Bytes = std::vector<std::uint8_t>;

struct ModbusAnswer : testing::Test {
  Bytes answer(const Bytes& request) {
    std::array<std::uint8_t, kLargestPdu> reply{};
    const std::size_t bytes = answer_request(request, 1, registers_, reply);
    return {reply.begin(), reply.begin() + static_cast<std::ptrdiff_t>(bytes)};
  }
  test::NumberedRegisters registers_;
};

// The frames of the application protocol V1.1b3, chapter 6, with other numbers.
TEST_F(ModbusAnswer, EveryFunctionAnswersAsTheProtocolSays) {
  EXPECT_EQ(answer({3, 0, 5, 0, 2}), (Bytes{3, 4, 0, 5, 0, 6}));
  EXPECT_EQ(answer({4, 0, 5, 0, 1}), (Bytes{4, 2, 0, 5}));
  EXPECT_EQ(answer({6, 0, 7, 0x12, 0x34}), (Bytes{6, 0, 7, 0x12, 0x34}));
  EXPECT_EQ(registers_.values[7], 0x1234);
  EXPECT_EQ(answer({16, 0, 8, 0, 2, 4, 0xAB, 0xCD, 0, 1}), (Bytes{16, 0, 8, 0, 2}));
  EXPECT_EQ(registers_.values[8], 0xABCD);
  EXPECT_EQ(registers_.values[9], 1);
  // The write goes before the read.
  EXPECT_EQ(answer({23, 0, 10, 0, 2, 0, 11, 0, 1, 2, 0x55, 0xAA}),
            (Bytes{23, 4, 0, 10, 0x55, 0xAA}));
  EXPECT_EQ(registers_.requests, 5);
}

TEST_F(ModbusAnswer, TheLargestRequestsAreTakenAndOneMoreIsRefused) {
  EXPECT_EQ(answer({3, 0, 0, 0, 125}).size(), 252U);
  EXPECT_EQ(answer({3, 0, 0, 0, 126}), (Bytes{0x83, 3}));
  const auto both = [](std::uint8_t count) {
    Bytes request = {23, 0, 0, 0, 125, 0, 0, 0, count, static_cast<std::uint8_t>(2 * count)};
    request.resize(request.size() + 2U * count);
    return request;
  };
  EXPECT_EQ(answer(both(121)).size(), 252U);
  EXPECT_EQ(answer(both(122)), (Bytes{0x97, 3}));
}

TEST_F(ModbusAnswer, WhatIsNotThereOrContradictsItselfIsRefused) {
  EXPECT_EQ(answer({3, 0, 129, 0, 2}), (Bytes{0x83, 2}));
  EXPECT_EQ(answer({6, 0xFF, 0xFF, 0, 0}), (Bytes{0x86, 2}));
  EXPECT_EQ(answer({3, 0, 0, 0, 0}), (Bytes{0x83, 3}));
  EXPECT_EQ(answer({16, 0, 0, 0, 2, 2, 0, 1}), (Bytes{0x90, 3}));           // byte count
  EXPECT_EQ(answer({16, 0, 0, 0, 2, 4, 0, 1, 0}), (Bytes{0x90, 3}));        // short
  EXPECT_EQ(answer({16, 0, 0, 0, 1, 2, 0, 1, 0, 1}), (Bytes{0x90, 3}));     // long
  EXPECT_EQ(answer({23, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0}), (Bytes{0x97, 3}));  // short
  EXPECT_EQ(answer({1, 0, 0, 0, 1}), (Bytes{0x81, 1}));
  EXPECT_EQ(answer({3}), (Bytes{0x83, 3}));
  EXPECT_TRUE(answer({}).empty());
}

TEST_F(ModbusAnswer, GarbageGetsAReplyThatIsNoLongerThanAPdu) {
  std::mt19937 engine(1);
  for (int i = 0; i < 20000; ++i) {
    Bytes request(engine() % (kLargestPdu + 1));
    for (std::uint8_t& byte : request) byte = static_cast<std::uint8_t>(engine() & 0xFFU);
    if (!request.empty() && i % 2 == 0) {
      constexpr std::array<std::uint8_t, 5> kFunctions = {3, 4, 6, 16, 23};
      request[0] = kFunctions[engine() % kFunctions.size()];
    }
    const Bytes reply = answer(request);
    EXPECT_EQ(reply.empty(), request.empty());
    if (!reply.empty()) {
      EXPECT_EQ(reply[0] & 0x7F, request[0] & 0x7F);
    }
  }
}

}  // namespace stageid::test_modbus_answer
