#include "acquisition/slog/crc32c.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string_view>
#include <vector>

namespace stageid::test_crc32c {

using Function = std::uint32_t (*)(std::span<const std::byte>, std::uint32_t) noexcept;

struct Crc32c : testing::TestWithParam<Function> {
  static std::uint32_t of(const std::vector<std::byte>& bytes) { return GetParam()(bytes, 0); }
};

std::vector<std::byte> counting(int first, int step) {
  std::vector<std::byte> bytes;
  for (int i = 0; i < 32; ++i) bytes.push_back(static_cast<std::byte>(first + step * i));
  return bytes;
}

// RFC 3720, appendix B.4, read as little-endian words; "123456789" is the catalogue's check value.
TEST_P(Crc32c, GivesThePublishedValues) {
  EXPECT_EQ(of(std::vector<std::byte>(32, std::byte{0x00})), 0x8A9136AAU);
  EXPECT_EQ(of(std::vector<std::byte>(32, std::byte{0xFF})), 0x62A8AB43U);
  EXPECT_EQ(of(counting(0, 1)), 0x46DD794EU);
  EXPECT_EQ(of(counting(31, -1)), 0x113FDB5CU);
  constexpr std::string_view check = "123456789";
  EXPECT_EQ(GetParam()(std::as_bytes(std::span(check)), 0), 0xE3069283U);
  EXPECT_EQ(of({}), 0U);
}

// Different lengths cover different parts of the interleaved streams, their shifts and the tail.
TEST_P(Crc32c, AgreesWithTheDefinitionBitByBitAtEveryLengthAndCut) {
  std::mt19937 engine(3);
  std::vector<std::byte> bytes(2 * 3 * 4096 + 77);
  for (std::byte& byte : bytes) byte = static_cast<std::byte>(engine() & 0xFFU);
  std::uint32_t bitwise = 0xFFFFFFFFU;
  for (std::size_t size = 1; size <= bytes.size(); ++size) {
    bitwise ^= std::to_integer<std::uint32_t>(bytes[size - 1]);
    for (int bit = 0; bit < 8; ++bit)
      bitwise = (bitwise >> 1) ^ ((bitwise & 1U) != 0 ? 0x82F63B78U : 0U);
    if (size % 61 != 0 && size > 300) continue;
    const std::span<const std::byte> whole(bytes.data(), size);
    ASSERT_EQ(GetParam()(whole, 0), ~bitwise) << size << " bytes";
    const std::size_t cut = engine() % (size + 1);
    ASSERT_EQ(GetParam()(whole.subspan(cut), GetParam()(whole.first(cut), 0)), ~bitwise)
        << size << " bytes, cut at " << cut;
  }
}

INSTANTIATE_TEST_SUITE_P(Both, Crc32c, testing::Values(&crc32c, &crc32c_portable),
                         [](const auto& which) { return which.index == 0 ? "Fast" : "Portable"; });

}  // namespace stageid::test_crc32c
