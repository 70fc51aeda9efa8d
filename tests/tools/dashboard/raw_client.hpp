#pragma once

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

namespace stageid::test {

/// A connection to this machine that may or may not read what it is sent.
class RawClient {
 public:
  /// Sends `begin` of a request. @param more flags of the socket
  RawClient(int port, const std::string& begin, int more = 0, int buffer_bytes = 1024)
      : socket_(::socket(AF_INET, SOCK_STREAM | more, 0)) {
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    good_ = ::connect(socket_, reinterpret_cast<sockaddr*>(&to), sizeof to) == 0 && send(begin);
  }
  ~RawClient() { ::close(socket_); }
  RawClient(RawClient&&) = delete;
  bool good() const { return good_; }
  /// False if the other end has hung up.
  bool send(const std::string& bytes) const {
    return ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) ==
           static_cast<ssize_t>(bytes.size());
  }
  /// What comes until `end` is in it.
  std::string read_until(const std::string& end) const {
    std::string text;
    char piece[512];
    while (text.find(end) == std::string::npos) {
      const ssize_t n = ::recv(socket_, piece, sizeof piece, 0);
      if (n <= 0) break;
      text.append(piece, static_cast<std::size_t>(n));
    }
    return text;
  }

 private:
  int socket_;
  bool good_ = false;
};

}  // namespace stageid::test
