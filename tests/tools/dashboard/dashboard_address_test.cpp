#include "tools/dashboard/dashboard_address.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace stageid::test_dashboard_address {

TEST(DashboardAddress, APortAloneIsThisMachineOnly) {
  const DashboardAddress address = parse_dashboard_address("8080");
  EXPECT_EQ(address.host, "127.0.0.1");
  EXPECT_EQ(address.port, 8080);
  EXPECT_TRUE(address.is_loopback());
}

TEST(DashboardAddress, AHostMayBeGiven) {
  EXPECT_EQ(parse_dashboard_address("stage-pc:0").host, "stage-pc");
  EXPECT_FALSE(parse_dashboard_address("0.0.0.0:80").is_loopback());
  EXPECT_FALSE(parse_dashboard_address("stage-pc:80").is_loopback());
  EXPECT_TRUE(parse_dashboard_address("localhost:80").is_loopback());
  EXPECT_EQ(parse_dashboard_address("[::1]:80").host, "::1");
  EXPECT_TRUE(parse_dashboard_address("[::1]:80").is_loopback());
}

TEST(DashboardAddress, RefusesWhatIsNoPort) {
  for (const char* text : {"", "x", "-1", "65536", "80x", "host:", ":80", "host:99999"})
    EXPECT_THAT([&] { parse_dashboard_address(text); },
                testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("--dashboard")))
        << text;
}

TEST(DashboardToken, IsLongAndNeverTheSame) {
  const std::string token = make_token();
  EXPECT_EQ(token.size(), 32U);
  EXPECT_NE(token, make_token());
  EXPECT_TRUE(same_token(token, token));
  EXPECT_FALSE(same_token(token, token.substr(1)));
  std::string other = token;
  other[0] = 'x';
  EXPECT_FALSE(same_token(token, other));
  EXPECT_FALSE(same_token("", token));
}

}  // namespace stageid::test_dashboard_address
