#pragma once

#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <stdexcept>
#include <string>
#include <thread>

namespace stageid::test {

/// Two serial devices with a line between them, as `socat pty pty` makes them.
class PtyPair {
 public:
  PtyPair() : thread_([this] { carry(); }) {}
  ~PtyPair() {
    stop_ = true;
    thread_.join();
  }
  PtyPair(PtyPair&&) = delete;

  const std::string& first() const { return ends_[0].name; }
  const std::string& second() const { return ends_[1].name; }

 private:
  struct End {
    End() : master(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
      if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0)
        throw std::runtime_error("no pty");
      name = ptsname(master);
      slave = open(name.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);  // else the master hangs up
      termios raw{};
      tcgetattr(slave, &raw);
      cfmakeraw(&raw);
      tcsetattr(slave, TCSANOW, &raw);
    }
    ~End() {
      close(slave);
      close(master);
    }
    End(End&&) = delete;
    int master;
    int slave = -1;
    std::string name;
  };

  void carry() {
    while (!stop_) {
      std::array<pollfd, 2> waiting = {
          {{ends_[0].master, POLLIN, 0}, {ends_[1].master, POLLIN, 0}}};
      if (poll(waiting.data(), waiting.size(), 5) <= 0) continue;
      for (std::size_t i = 0; i < 2; ++i) {
        std::array<char, 512> bytes{};
        if ((waiting[i].revents & POLLIN) == 0) continue;
        const ssize_t count = read(ends_[i].master, bytes.data(), bytes.size());
        if (count > 0 &&
            write(ends_[1 - i].master, bytes.data(), static_cast<std::size_t>(count)) < 0)
          return;
      }
    }
  }

  std::array<End, 2> ends_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace stageid::test
