#include "tools/dashboard/dashboard_address.hpp"

#include <fmt/format.h>

#include <charconv>
#include <random>

#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

[[noreturn]] void refuse(const std::string& text) {
  fail_request(
      "--dashboard: got '{}'; expected PORT (this machine only) or HOST:PORT, with a port from 0 "
      "to 65535",
      text);
}

}  // namespace

bool DashboardAddress::is_loopback() const {
  return host == "localhost" || host == "::1" || host.rfind("127.", 0) == 0;
}

DashboardAddress parse_dashboard_address(const std::string& text) {
  DashboardAddress address;
  std::string port = text;
  if (const std::size_t colon = text.rfind(':'); colon != std::string::npos) {
    address.host = text.substr(0, colon);
    port = text.substr(colon + 1);
    if (address.host.size() > 2 && address.host.front() == '[' && address.host.back() == ']')
      address.host = address.host.substr(1, address.host.size() - 2);
    if (address.host.empty()) refuse(text);
  }
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), address.port);
  if (error != std::errc() || end != port.data() + port.size() || address.port < 0 ||
      address.port > 65535)
    refuse(text);
  return address;
}

std::string make_token() {
  std::random_device device;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", device(), device(), device(), device());
}

bool same_token(const std::string& a, const std::string& b) noexcept {
  if (a.size() != b.size()) return false;
  unsigned different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different |= static_cast<unsigned>(a[i] ^ b[i]);
  return different == 0;
}

}  // namespace stageid
