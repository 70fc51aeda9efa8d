#include "tools/report/report_packing.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/tools/report/packed_reader.hpp"

namespace stageid::report {
namespace test_report_packing {

std::vector<std::uint8_t> bytes(const std::string& text) { return {text.begin(), text.end()}; }

TEST(ReportPacking, Base64HasTheVectorsOfRfc4648) {
  EXPECT_EQ(base64(bytes("")), "");
  EXPECT_EQ(base64(bytes("f")), "Zg==");
  EXPECT_EQ(base64(bytes("fo")), "Zm8=");
  EXPECT_EQ(base64(bytes("foo")), "Zm9v");
  EXPECT_EQ(base64(bytes("foob")), "Zm9vYg==");
  EXPECT_EQ(base64(bytes("fooba")), "Zm9vYmE=");
  EXPECT_EQ(base64(bytes("foobar")), "Zm9vYmFy");
  const std::vector<std::uint8_t> high = {0xff, 0xef, 0xbe};
  EXPECT_EQ(base64(high), "/+++");
}

TEST(ReportPacking, UnpacksToTheSameBytes) {
  std::vector<std::uint8_t> many;
  for (std::uint32_t i = 0, x = 1; i < 100'000; ++i, x = x * 1664525u + 1013904223u)
    many.push_back(static_cast<std::uint8_t>(i % 3 == 0 ? 7 : x >> 24));
  for (const std::vector<std::uint8_t>& raw : {many, bytes("a"), bytes("")})
    EXPECT_EQ(test::unpacked(packed(raw)), raw);
  // Of three bytes one is known, which costs a bit or so.
  EXPECT_LT(packed(many).size(), base64(many).size() * 8 / 10);
}

TEST(ReportPacking, BytesOfTheSamePlaceStandTogether) {
  const std::vector<std::uint16_t> numbers = {0x0102, 0x0304, 0x0506};
  EXPECT_EQ(byte_planes(numbers), (std::vector<std::uint8_t>{2, 4, 6, 1, 3, 5}));
  EXPECT_EQ(test::numbers_of_planes<std::uint16_t>(byte_planes(numbers)), numbers);
}

}  // namespace test_report_packing
}  // namespace stageid::report
