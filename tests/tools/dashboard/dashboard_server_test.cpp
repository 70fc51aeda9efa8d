// The server of the dashboard by itself: permissions, and watchers that do not read.
#include "tools/dashboard/dashboard_server.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

#include "hal/stage/stage.hpp"
#include "tests/support/process/resident_bytes.hpp"
#include "tests/tools/dashboard/raw_client.hpp"

namespace stageid::test_dashboard_server {

using namespace std::chrono_literals;
using test::RawClient;

/// A request that never ends.
const std::string kEndless = "GET / HTTP/1.1\r\nX: ";

struct DashboardServerTest : testing::Test {
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
  /// Of our page, with its header.
  httplib::Result abort(const std::string& query, const std::string& body = "") const {
    return client().Post("/abort" + query, {{"X-Stageid", "abort"}}, body, "text/plain");
  }
  std::string with_token() const { return "?token=" + token_; }
  std::string events() const {
    return "GET /events HTTP/1.1\r\nHost: localhost:" + std::to_string(port_) + "\r\n\r\n";
  }
  std::vector<std::unique_ptr<RawClient>> clients(int count, const std::string& begin,
                                                  int more = 0) const {
    std::vector<std::unique_ptr<RawClient>> all;
    for (int i = 0; i < count; ++i) all.push_back(std::make_unique<RawClient>(port_, begin, more));
    return all;
  }
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

TEST_F(DashboardServerTest, ServesMetricsAndTheHistoryOfAWatch) {
  content_.history = [] { return "{3}"; };
  serve();
  EXPECT_EQ(client().Get("/metrics")->body, "");
  content_.state.publish(R"({"state":"running","health":{"cycles":7}})");
  const httplib::Result metrics = client().Get("/metrics");
  EXPECT_THAT(metrics->get_header_value("Content-Type"),
              testing::StartsWith("text/plain; version=0.0.4"));
  EXPECT_THAT(metrics->body, testing::HasSubstr("\nstageid_cycles_total 7\n"));
  EXPECT_EQ(client().Get("/watch.json")->body, "{3}");
}

TEST_F(DashboardServerTest, ServesTheTraceOfAChannel) {
  content_.trace = [](int channel) { return fmt::format("{{{}}}", channel); };
  serve();
  EXPECT_EQ(client().Get("/trace.json?channel=3")->body, "{3}");
  for (const char* wrong : {"/trace.json", "/trace.json?channel=",
                            "/trace.json?channel=99999999999", "/trace.json?channel=x"})
    EXPECT_EQ(client().Get(wrong)->body, "{-1}") << wrong;
}

TEST_F(DashboardServerTest, ClientsThatTrickleTheirHeaderDoNotLockOthersOut) {
  serve();
  constexpr int kMoreThanThreads = DashboardServer::kWatchers + 16;
  const auto slow = clients(kMoreThanThreads, kEndless);
  for (const auto& one : slow) ASSERT_TRUE(one->good());
  std::atomic<bool> stop = false;
  std::thread trickle([&] {
    while (!stop) {
      for (const auto& one : slow) one->send("x");
      std::this_thread::sleep_for(200ms);
    }
  });
  httplib::Client other = client();
  other.set_read_timeout(20s);
  const httplib::Result result = other.Get("/");
  stop = true;
  trickle.join();
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
  const auto slow = clients(100, kEndless);
  // None waits for its turn in the short queue of the port.
  auto idle = clients(1000, "", SOCK_NONBLOCK);
  const auto began = std::chrono::steady_clock::now();
  httplib::Client other = client();
  other.set_read_timeout(30s);
  other.set_keep_alive(false);
  const httplib::Result page = other.Get("/");
  const httplib::Result abort =
      other.Post("/abort" + with_token(), {{"X-Stageid", "abort"}}, "", "text/plain");
  const auto took = std::chrono::steady_clock::now() - began;
  idle.clear();
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
    const RawClient client(port_, begin);
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
  const RawClient watcher(port_, events());
  EXPECT_THAT(watcher.read_until("\"n\":1"), testing::HasSubstr("text/event-stream"));
  EXPECT_EQ(watched_, 1);
  content_.state.publish("{\"n\":2}");
  EXPECT_THAT(watcher.read_until("\"n\":2"), testing::HasSubstr("data: {\"n\":2}\n\n"));
}

TEST_F(DashboardServerTest, OnlyAPageOfOursCanAbort) {
  serve();
  EXPECT_EQ(client().Post("/abort")->status, 403);
  EXPECT_EQ(client().Get("/abort")->status, 404);
  EXPECT_EQ(client().Post("/abort" + with_token())->status, 403) << "not a page of ours";
  EXPECT_EQ(aborts_, 0);
  EXPECT_EQ(abort(with_token())->status, 200);
  EXPECT_EQ(aborts_, 1);
}

TEST_F(DashboardServerTest, WithoutTheTokenOneMayWatchOnLoopbackButNotAbort) {
  serve();
  for (const char* query : {"", "?token=", "?token=wrong"}) {
    const auto answer = abort(query);
    EXPECT_EQ(answer->status, 403) << query;
    EXPECT_THAT(answer->body, testing::HasSubstr("with its token"));
  }
  EXPECT_EQ(aborts_, 0);
  EXPECT_EQ(client().Get("/")->status, 200);
}

TEST_F(DashboardServerTest, RefusesLargeBodiesAndSaysWhatItRefuses) {
  serve();
  const auto answer = abort(with_token(), std::string(DashboardServer::kLargestBody + 1, 'x'));
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
  EXPECT_EQ(abort("")->status, 403);
  EXPECT_EQ(aborts_, 0);
  EXPECT_EQ(client().Get("/" + with_token())->status, 200);
  EXPECT_EQ(abort(with_token())->status, 200);
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
    const auto watchers = clients(DashboardServer::kWatchers, events());
    ASSERT_TRUE(watchers_become(DashboardServer::kWatchers));
    EXPECT_EQ(client().Get("/events")->status, 503);
    EXPECT_EQ(client().Get("/")->status, 200) << "the page, and with it the button, is still there";
  }
  EXPECT_TRUE(watchers_become(0));
}

TEST_F(DashboardServerTest, OneThatNeverReadsIsLetGoAndHoldsNobodyUp) {
  serve();
  const RawClient deaf(port_, events());
  const RawClient good(port_, events());
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
  const RawClient stays(port_, events());
  ASSERT_TRUE(watchers_become(1));
  server_->finish(100ms);
  EXPECT_EQ(server_->watchers(), 1);
  server_.reset();  // and the stream is ended
  EXPECT_THAT(stays.read_until("0\r\n\r\n"), testing::HasSubstr("data: {}"));
}

}  // namespace stageid::test_dashboard_server
