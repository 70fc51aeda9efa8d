#pragma once

#include <string>

namespace stageid {

/// Address at which the dashboard listens.
struct DashboardAddress {
  std::string host = "127.0.0.1";
  int port = 0;                      ///< 0: any free port
  const char* flag = "--dashboard";  ///< for errors

  /// True if other machines cannot reach it; then no token is required.
  bool is_loopback() const;
};

/// Reads "PORT" or "HOST:PORT" ("[::1]:8080" for an IPv6 address).
/// @throws std::invalid_argument naming --dashboard.
DashboardAddress parse_dashboard_address(const std::string& text);

/// 128 random bits as text, from the operating system. The token permits watching and aborting.
std::string make_token();

/// Comparison in a time that does not depend on the position of a difference.
bool same_token(const std::string& a, const std::string& b) noexcept;

}  // namespace stageid
