#include "hal/can/can_socket.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <linux/can/error.h>
#include <netinet/in.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstring>
#include <ctime>
#include <thread>

#include "hal/can/can_transport.hpp"
#include "hal/stage/pacer.hpp"
#include "tests/support/stages/can_pair.hpp"

namespace stageid::test_can_socket {

/// A socket that receives what it sends to itself. The kernel stamps UDP as it stamps CAN.
class Loopback {
 public:
  Loopback() : fd_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    auto* const any = reinterpret_cast<sockaddr*>(&address);
    socklen_t size = sizeof address;
    if (bind(fd_, any, size) != 0 || getsockname(fd_, any, &size) != 0 ||
        connect(fd_, any, size) != 0)
      ADD_FAILURE() << "no loopback";
  }
  ~Loopback() { close(fd_); }
  Loopback(Loopback&&) = delete;

  int fd() const { return fd_; }
  void send() const { ASSERT_EQ(::send(fd_, "x", 1, 0), 1); }
  std::int64_t receive(CanArrivals& arrivals) const {
    char data = 0;
    iovec part{&data, 1};
    alignas(cmsghdr) std::array<char, kArrivalControlBytes> control{};
    msghdr header{};
    header.msg_iov = &part;
    header.msg_iovlen = 1;
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    arrivals.begin(monotonic_ns());
    EXPECT_EQ(recvmsg(fd_, &header, 0), 1);
    return arrivals.arrival_ns(header);
  }

 private:
  int fd_;
};

TEST(CanArrival, IsWhenTheFrameCameAndNotWhenItWasRead) {
  const Loopback link;
  stamp_arrivals(link.fd());
  CanArrivals arrivals;
  // The kernel begins to stamp some time after it was asked to.
  for (int attempt = 0; attempt < 100; ++attempt) {
    const std::int64_t before = monotonic_ns();
    link.send();
    const std::int64_t sent = monotonic_ns();
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    const std::int64_t reading = monotonic_ns();
    const std::int64_t arrival = link.receive(arrivals);
    if (arrival >= reading) continue;
    constexpr std::int64_t kClocks_ns = 100'000;  // two clocks are not read in the same instant
    EXPECT_GE(arrival, before - kClocks_ns);
    EXPECT_LE(arrival, sent + (reading - sent) / 2);
    return;
  }
  FAIL() << "no frame was stamped";
}

TEST(CanArrival, WithoutAStampItIsWhenItWasRead) {
  const Loopback link;
  CanArrivals arrivals;
  link.send();
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  const std::int64_t before = monotonic_ns();
  EXPECT_GE(link.receive(arrivals), before);
}

/// Control data as the driver of a controller with a clock gives them.
std::int64_t arrival_of(CanArrivals& arrivals, std::int64_t kernel_ns, std::int64_t controller_ns) {
  alignas(cmsghdr) std::array<char, kArrivalControlBytes> control{};
  msghdr header{};
  header.msg_control = control.data();
  header.msg_controllen = control.size();
  cmsghdr* const c = CMSG_FIRSTHDR(&header);
  c->cmsg_level = SOL_SOCKET;
  c->cmsg_type = SO_TIMESTAMPING;
  c->cmsg_len = CMSG_LEN(3 * sizeof(timespec));
  const auto time = [](std::int64_t ns) {
    return timespec{ns / 1'000'000'000, ns % 1'000'000'000};
  };
  const std::array<timespec, 3> stamps = {time(kernel_ns), timespec{}, time(controller_ns)};
  std::memcpy(CMSG_DATA(c), stamps.data(), sizeof stamps);
  return arrivals.arrival_ns(header);
}

TEST(CanArrival, TheControllersClockTakesTheJitterOfTheKernelAway) {
  CanArrivals arrivals;
  timespec realtime{};
  clock_gettime(CLOCK_REALTIME, &realtime);
  const std::int64_t kernel = realtime.tv_sec * 1'000'000'000 + realtime.tv_nsec - 100'000'000;
  arrivals.begin(monotonic_ns());
  std::int64_t last = 0;
  for (std::int64_t n = 0; n < 100; ++n) {
    // The kernel is 100 us late with every other frame; the controller counts from its start.
    const std::int64_t late = n % 2 == 0 ? 0 : 100'000;
    const std::int64_t arrival =
        arrival_of(arrivals, kernel + n * 1'000'000 + late, 5'000'000 + n * 1'000'000);
    // The mean latency of 50 us is left, and 1/50 of the deviation.
    if (n > 60) {
      EXPECT_NEAR(static_cast<double>(arrival - last), 1e6, 5e3);
    }
    last = arrival;
  }
}

TEST(SocketCan, ReadsErrorFramesAsTheKernelMeansThem) {
  using State = CanBusState;
  const auto after = [](State before, unsigned class_bits, unsigned controller) {
    return can_state_after_error(before, class_bits, static_cast<std::uint8_t>(controller));
  };
  EXPECT_EQ(after(State::active, CAN_ERR_BUSOFF, 0), State::off);
  EXPECT_EQ(after(State::off, CAN_ERR_RESTARTED, 0), State::active);
  EXPECT_EQ(after(State::active, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE), State::passive);
  EXPECT_EQ(after(State::active, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE), State::passive);
  EXPECT_EQ(after(State::active, CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING), State::warning);
  EXPECT_EQ(after(State::passive, CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE), State::active);
  EXPECT_EQ(after(State::passive, CAN_ERR_ACK, 0), State::passive);
  EXPECT_EQ(after(State::warning, CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW), State::warning);
}

TEST(SocketCan, RefusesInterfacesThatAreNotThere) {
  EXPECT_THROW(SocketCan({}, {}), StageError);
  // Without CAN in the kernel the socket fails, with it the name.
  EXPECT_THROW(SocketCan({"no-such-can"}, {}), StageError);
}

TEST(CanTransport, TheWorstBusCounts) {
  test::CanPair pair({"one", "two", "three"});
  EXPECT_EQ(worst_bus(pair.host()).state, CanBusState::active);
  pair.set_state(1, CanBusState::passive);
  pair.set_state(2, CanBusState::warning);
  EXPECT_EQ(worst_bus(pair.host()).state, CanBusState::passive);
  EXPECT_EQ(worst_bus(pair.host()).bus, 1U);
  EXPECT_STREQ(to_string(CanBusState::down), "interface down");
}

}  // namespace stageid::test_can_socket
