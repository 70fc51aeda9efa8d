#pragma once

#include <string>

namespace stageid {

/// Where the dashboard listens.
struct DashboardAddress {
  std::string host = "127.0.0.1";
  int port = 0;  ///< 0: any that is free

  /// True if no other machine can reach it; then no token is asked for.
  bool is_loopback() const;
};

/// Reads "PORT" or "HOST:PORT" ("[::1]:8080" for an IPv6 address).
/// @throws std::invalid_argument naming --dashboard.
DashboardAddress parse_dashboard_address(const std::string& text);

/// 128 random bits as text, from the operating system: whoever has it may look and may abort.
std::string make_token();

/// Equal, in a time that does not tell where they part.
bool same_token(const std::string& a, const std::string& b) noexcept;

}  // namespace stageid
