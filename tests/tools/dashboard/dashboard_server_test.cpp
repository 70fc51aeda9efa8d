// The server of the dashboard by itself: permissions, and watchers that do not read.
#include "tools/dashboard/dashboard_server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

#include "hal/stage/stage.hpp"
#include "tests/support/process/resident_bytes.hpp"

namespace stageid {
namespace test_dashboard_server {

using namespace std::chrono_literals;

bool connect_here(int socket, int port) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return ::connect(socket, reinterpret_cast<sockaddr*>(&to), sizeof to) == 0;
}

/// A connection that requests the stream and may or may not read it.
class RawWatcher {
 public:
  struct Request {
    std::string bytes;
  };
  explicit RawWatcher(int port, const std::string& path = "/events")
      : RawWatcher(port, Request{"GET " + path + " HTTP/1.1\r\nHost: localhost:" +
                                 std::to_string(port) + "\r\n\r\n"}) {}
  RawWatcher(int port, const Request& request) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const int small = 1024;
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    good_ = connect_here(socket_, port) && send(request.bytes);
  }
  ~RawWatcher() { ::close(socket_); }
  RawWatcher(const RawWatcher&) = delete;
  RawWatcher& operator=(const RawWatcher&) = delete;
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

class DashboardServerTest : public testing::Test {
 protected:
  DashboardServerTest() {
    content_.page = "<p>page</p>";
    content_.abort = [this] { ++aborts_; };
    content_.watched = [this] { ++watched_; };
  }
  void serve(const std::string& address = "0") {
    server_ = std::make_unique<DashboardServer>(parse_dashboard_address(address), content_);
    const std::string& url = server_->url();
    const std::size_t colon = url.find(':', 7);
    port_ = std::stoi(url.substr(colon + 1));
    if (const auto at = url.find("token="); at != std::string::npos) token_ = url.substr(at + 6);
  }
  httplib::Client client() const { return httplib::Client("127.0.0.1", port_); }
  bool watchers_become(int wanted) const {
    for (int i = 0; i < 2000 && server_->watchers() != wanted; ++i)
      std::this_thread::sleep_for(10ms);
    return server_->watchers() == wanted;
  }

  DashboardContent content_;
  std::atomic<int> aborts_ = 0;
  std::atomic<int> watched_ = 0;
  std::unique_ptr<DashboardServer> server_;
  int port_ = 0;
  std::string token_;
};

TEST_F(DashboardServerTest, ServesThePageAndTheNewestResponse) {
  serve();
  EXPECT_THAT(server_->url(), testing::StartsWith("http://127.0.0.1:"));
  EXPECT_EQ(client().Get("/")->body, "<p>page</p>");
  EXPECT_EQ(client().Get("/response.json")->status, 404);
  content_.response.publish("{1}");
  content_.response.publish("{2}");
  EXPECT_EQ(client().Get("/response.json")->body, "{2}");
  EXPECT_EQ(client().Get("/other")->status, 404);
}

TEST_F(DashboardServerTest, ClientsThatTrickleTheirHeaderDoNotLockOthersOut) {
  serve();
  constexpr int kMoreThanThreads = DashboardServer::kWatchers + 16;
  std::vector<int> sockets;
  for (int i = 0; i < kMoreThanThreads; ++i) {
    sockets.push_back(::socket(AF_INET, SOCK_STREAM, 0));
    ASSERT_TRUE(connect_here(sockets.back(), port_));
    const std::string begin = "GET / HTTP/1.1\r\nX: ";
    ASSERT_GT(::send(sockets.back(), begin.data(), begin.size(), MSG_NOSIGNAL), 0);
  }
  std::atomic<bool> stop = false;
  std::thread trickle([&] {
    while (!stop) {
      for (const int socket : sockets) ::send(socket, "x", 1, MSG_NOSIGNAL);
      std::this_thread::sleep_for(200ms);
    }
  });
  httplib::Client other = client();
  other.set_read_timeout(20s);
  const httplib::Result result = other.Get("/");
  stop = true;
  trickle.join();
  for (const int socket : sockets) ::close(socket);
  ASSERT_TRUE(result) << "no answer";
  EXPECT_EQ(result->body, "<p>page</p>");
}

TEST_F(DashboardServerTest, AThousandIdleAndAHundredSlowClientsDelayNobody) {
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  files.rlim_cur = std::min<rlim_t>(files.rlim_max, 4096);
  ::setrlimit(RLIMIT_NOFILE, &files);
  serve();
  const std::size_t before = test::resident_bytes();
  std::vector<std::unique_ptr<RawWatcher>> slow;
  for (int i = 0; i < 100; ++i)
    slow.push_back(
        std::make_unique<RawWatcher>(port_, RawWatcher::Request{"GET / HTTP/1.1\r\nX: "}));
  std::vector<int> idle;
  for (int i = 0; i < 1000; ++i) {  // none waits for its turn in the short queue of the port
    idle.push_back(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK, 0));
    connect_here(idle.back(), port_);
  }
  const auto began = std::chrono::steady_clock::now();
  httplib::Client other = client();
  other.set_read_timeout(30s);
  other.set_keep_alive(false);
  const httplib::Result page = other.Get("/");
  const httplib::Result abort =
      other.Post("/abort?token=" + token_, {{"X-Stageid", "abort"}}, "", "text/plain");
  const auto took = std::chrono::steady_clock::now() - began;
  for (const int socket : idle) ::close(socket);
  EXPECT_LT(took, 10s) << "silent clients keep their threads while others wait";
  ASSERT_TRUE(page) << "no answer";
  EXPECT_EQ(page->body, "<p>page</p>");
  ASSERT_TRUE(abort) << "no answer";
  EXPECT_EQ(aborts_, 1);
  EXPECT_LT(test::resident_bytes() - before, std::size_t{32} << 20);
}

TEST_F(DashboardServerTest, KeepsNoMoreOfARequestThanABrowserSends) {
  serve();
  const std::string post = "POST /abort HTTP/1.1\r\nHost: localhost:" + std::to_string(port_);
  const std::string junk(std::size_t{1} << 16, 'x');
  for (const std::string& begin :
       {std::string(), post + "\r\n\r\n", post + "\r\nContent-Length: 1000000000\r\n\r\n",
        post + "\r\nTransfer-Encoding: chunked\r\n\r\n7FFFFFFF\r\n"}) {
    const RawWatcher client(port_, RawWatcher::Request{begin});
    std::size_t sent = 0;
    constexpr std::size_t kMost = std::size_t{64} << 20;
    while (sent < kMost && client.send(junk)) sent += junk.size();
    EXPECT_LT(sent, kMost) << begin;  // the server hung up
  }
  EXPECT_EQ(client().Get("/")->body, "<p>page</p>");
}

TEST_F(DashboardServerTest, SendsThePageOnceHoweverManyRangesAreAskedFor) {
  serve();
  std::string ranges = "bytes=0-";
  for (int k = 0; k < 1000; ++k) ranges += ",0-";
  const auto answer = client().Get("/", {{"Range", ranges}});
  ASSERT_TRUE(answer);
  EXPECT_LT(answer->body.size(), 100U);
}

TEST_F(DashboardServerTest, StreamsTheNewestState) {
  content_.state.publish("{\"n\":1}");
  serve();
  const RawWatcher watcher(port_);
  EXPECT_THAT(watcher.read_until("\"n\":1"), testing::HasSubstr("text/event-stream"));
  EXPECT_EQ(watched_, 1);
  content_.state.publish("{\"n\":2}");
  EXPECT_THAT(watcher.read_until("\"n\":2"), testing::HasSubstr("data: {\"n\":2}\n\n"));
}

TEST_F(DashboardServerTest, OnlyAPageOfOursCanAbort) {
  serve();
  EXPECT_EQ(client().Post("/abort")->status, 403);
  EXPECT_EQ(client().Get("/abort")->status, 404);
  EXPECT_EQ(client().Post("/abort?token=" + token_)->status, 403) << "not a page of ours";
  EXPECT_EQ(aborts_, 0);
  EXPECT_EQ(
      client().Post("/abort?token=" + token_, {{"X-Stageid", "abort"}}, "", "text/plain")->status,
      200);
  EXPECT_EQ(aborts_, 1);
}

TEST_F(DashboardServerTest, WithoutTheTokenOneMayWatchOnLoopbackButNotAbort) {
  serve();
  for (const char* path : {"/abort", "/abort?token=", "/abort?token=wrong"}) {
    const auto answer = client().Post(path, {{"X-Stageid", "abort"}}, "", "text/plain");
    EXPECT_EQ(answer->status, 403) << path;
    EXPECT_THAT(answer->body, testing::HasSubstr("with its token"));
  }
  EXPECT_EQ(aborts_, 0);
  EXPECT_EQ(client().Get("/")->status, 200);
}

TEST_F(DashboardServerTest, RefusesLargeBodiesAndSaysWhatItRefuses) {
  serve();
  const std::string large(DashboardServer::kLargestBody + 1, 'x');
  const auto answer =
      client().Post("/abort?token=" + token_, {{"X-Stageid", "abort"}}, large, "text/plain");
  EXPECT_EQ(answer->status, 413);
  EXPECT_EQ(answer->body, "body too large; at most 1024 bytes\n");
  EXPECT_EQ(aborts_, 0);
  EXPECT_EQ(client().Get("/other")->body, "/other: not found; open /\n");
  EXPECT_EQ(client().Get("/response.json")->body,
            "no response yet; wait for the first complete realization\n");
}

TEST_F(DashboardServerTest, OnLoopbackAnotherNameOfThisMachineIsRefused) {
  serve();
  const auto answer = client().Get("/", {{"Host", "evil.example"}});
  EXPECT_EQ(answer->status, 403);
}

TEST_F(DashboardServerTest, ReachableFromOutsideItAsksForTheToken) {
  serve("0.0.0.0:0");
  ASSERT_EQ(token_.size(), 32U);
  for (const char* path : {"/", "/events", "/response.json", "/?token=", "/?token=wrong"})
    EXPECT_EQ(client().Get(path)->status, 403) << path;
  EXPECT_EQ(client().Post("/abort", {{"X-Stageid", "abort"}}, "", "text/plain")->status, 403);
  EXPECT_EQ(aborts_, 0);
  EXPECT_EQ(client().Get("/?token=" + token_)->status, 200);
  EXPECT_EQ(
      client().Post("/abort?token=" + token_, {{"X-Stageid", "abort"}}, "", "text/plain")->status,
      200);
}

TEST_F(DashboardServerTest, AnAddressThatCannotBeHadIsAnError) {
  serve();
  DashboardContent other;
  EXPECT_THAT(
      [&] {
        DashboardServer({"127.0.0.1", port_}, other);
      },
      testing::ThrowsMessage<StageError>(testing::HasSubstr("another port")));
  EXPECT_THAT(
      [&] {
        DashboardServer({"203.0.113.7", 0}, other);
      },
      testing::ThrowsMessage<StageError>(testing::HasSubstr("203.0.113.7")));
}

TEST_F(DashboardServerTest, TooManyWatchersAreSentAwayAndPlacesComeFree) {
  content_.state.publish("{}");
  serve();
  {
    std::vector<std::unique_ptr<RawWatcher>> watchers;
    for (int i = 0; i < DashboardServer::kWatchers; ++i)
      watchers.push_back(std::make_unique<RawWatcher>(port_));
    ASSERT_TRUE(watchers_become(DashboardServer::kWatchers));
    EXPECT_EQ(client().Get("/events")->status, 503);
    EXPECT_EQ(client().Get("/")->status, 200) << "the page, and with it the button, is still there";
  }
  EXPECT_TRUE(watchers_become(0));
}

TEST_F(DashboardServerTest, OneThatNeverReadsIsLetGoAndHoldsNobodyUp) {
  serve();
  const RawWatcher deaf(port_);
  const RawWatcher good(port_);
  ASSERT_TRUE(deaf.good() && watchers_become(2));
  std::thread reader([&] { good.read_until("last"); });
  // More than all buffers on the way hold.
  const std::string much(200'000, 'x');
  for (int i = 0; i < 200 && server_->watchers() == 2; ++i) {
    content_.state.publish(much);  // returns at once, regardless of readers
    std::this_thread::sleep_for(50ms);
  }
  EXPECT_EQ(server_->watchers(), 1);
  content_.state.publish("last");
  reader.join();
}

TEST_F(DashboardServerTest, FinishWaitsForNobodyForEver) {
  content_.state.publish("{}");
  serve();
  const RawWatcher stays(port_);
  ASSERT_TRUE(watchers_become(1));
  server_->finish(100ms);
  EXPECT_EQ(server_->watchers(), 1);
  server_.reset();  // and the stream is ended
  EXPECT_THAT(stays.read_until("0\r\n\r\n"), testing::HasSubstr("data: {}"));
}

}  // namespace test_dashboard_server
}  // namespace stageid
