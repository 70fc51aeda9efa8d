#include "hal/modbus/modbus_encoding.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace stageid::test_modbus_encoding {

TEST(ModbusEncoding, TheMoreSignificantWordComesFirst) {
  std::array<std::uint16_t, 4> r{};
  const RegisterBlock block(300, r);
  block.set_u32(300, 0x53544749);
  EXPECT_EQ(r[0], 0x5354);
  EXPECT_EQ(r[1], 0x4749);
  block.set_u64(300, 0x0123456789ABCDEF);
  EXPECT_EQ(r, (std::array<std::uint16_t, 4>{0x0123, 0x4567, 0x89AB, 0xCDEF}));
  EXPECT_EQ(block.u64(300), 0x0123456789ABCDEFU);
  EXPECT_EQ(block.u32(302), 0x89ABCDEFU);
}

// Bit patterns of IEEE 754 and of two's complement, written out.
TEST(ModbusEncoding, FloatsAndSignedNumbersAreTheirBits) {
  std::array<std::uint16_t, 2> r{};
  const RegisterBlock block(0, r);
  block.set_f32(0, 1.5F);
  EXPECT_EQ(r, (std::array<std::uint16_t, 2>{0x3FC0, 0x0000}));
  EXPECT_EQ(block.f32(0), 1.5);
  block.set_f32(0, -295.25F);
  EXPECT_EQ(r, (std::array<std::uint16_t, 2>{0xC393, 0xA000}));
  EXPECT_EQ(block.f32(0), -295.25);
  block.set_i32(0, -2);
  EXPECT_EQ(r, (std::array<std::uint16_t, 2>{0xFFFF, 0xFFFE}));
  EXPECT_EQ(block.i32(0), -2);
}

TEST(ModbusEncoding, CountsAreTheNearestAndSaturate) {
  EXPECT_EQ(to_counts(3.4, 1.0), 3);
  EXPECT_EQ(to_counts(-3.6, 1.0), -4);
  EXPECT_EQ(to_counts(0.75, 0.5), 2);  // 1.5: to even
  EXPECT_EQ(to_counts(1e30, 1.0), 2147483647);
  EXPECT_EQ(to_counts(-std::numeric_limits<double>::infinity(), 1.0), -2147483647);
  EXPECT_EQ(to_counts(std::numeric_limits<double>::quiet_NaN(), 1.0), 0);
}

TEST(ModbusEncoding, KnowsWhatItCannotCarry) {
  EXPECT_TRUE(fits_counts(2147483647.0, 1.0));
  EXPECT_TRUE(fits_counts(-1.0, 0.5));
  EXPECT_FALSE(fits_counts(2147483648.0, 1.0));
  EXPECT_FALSE(fits_counts(-1e30, 1.0));
  EXPECT_FALSE(fits_counts(std::numeric_limits<double>::quiet_NaN(), 1.0));
}

TEST(ModbusEncoding, AScaleIsTheSmallestPowerOfTwoThatHoldsTheRange) {
  for (const double range : {40e-3, 2.0, 1.0, 2147483647.0, 80.0, 1e-20, 1e20}) {
    const auto scale = static_cast<double>(count_scale(range));
    int exponent = 0;
    EXPECT_EQ(std::frexp(scale, &exponent), 0.5) << range;
    EXPECT_GE(scale * 2147483647.0, range);
    EXPECT_LT(0.5 * scale * 2147483647.0, range);
  }
}

TEST(ModbusEncoding, ARangeThatCannotBeScaledIsRefused) {
  for (const double range : {0.0, -1.0, 1e-21, 1e21, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(static_cast<void>(count_scale(range)), std::invalid_argument) << range;
}

}  // namespace stageid::test_modbus_encoding
