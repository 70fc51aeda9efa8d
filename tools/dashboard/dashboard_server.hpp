#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "tools/dashboard/dashboard_address.hpp"
#include "tools/dashboard/latest_text.hpp"

namespace stageid {

/// The answer to an action of a page.
struct ActionReply {
  int status = 200;  ///< of HTTP
  std::string text;
};

/// Content and actions of the dashboard.
struct DashboardContent {
  std::string page;     ///< HTML
  LatestText state;     ///< the stream: one JSON object per line
  LatestText response;  ///< JSON of the newest FRF
  std::function<std::string()> history = [] { return "{}"; };  ///< JSON of what a watch has tracked
  /// JSON of the last seconds of a channel, see LiveTraces.
  std::function<std::string(int channel)> trace = [](int) { return "{}"; };
  std::function<void()> abort;            ///< called at the request of a watcher; must not block
  std::function<void()> watched = [] {};  ///< called when a watcher connects
  std::function<ActionReply(const std::string& body)> act = {};  ///< from any thread; empty: none
  bool secret = false;  ///< every request needs the token, on loopback too
};

/// Serves a page, the stream of its state (server-sent events), the newest response, the abort, and actions:
///   GET /   GET /events   GET /response.json   GET /watch.json   GET /trace.json?channel=N   GET /metrics   POST /abort   POST /act
///
/// It has its own threads, of low priority unless there are actions, and at most kWatchers streams at once (then 503). A
/// watcher receives the newest state when it is ready to read; nothing is queued for slow watchers, and one that does not
/// read for kPatience_s, or whose request takes longer, is disconnected. Other threads of the program never wait for the
/// server.
///
/// If other machines can reach it, a token is required (?token=...). On loopback, only requests addressed to this
/// machine are answered, and watching needs no token unless the content is secret. An abort or an action always needs the
/// token and a header that only our page can set, so that other web pages cannot use the browser of the user for it.
/// Requests with a body above kLargestBody are rejected.
class DashboardServer {
 public:
  static constexpr int kWatchers = 32;
  static constexpr int kPatience_s = 2;
  static constexpr std::size_t kLargestBody = 1024;

  /// Starts to listen and serve. `content` must outlive the server.
  /// @throws StageError with cause and remedy if the address is not available.
  DashboardServer(const DashboardAddress& address, DashboardContent& content);
  ~DashboardServer();
  DashboardServer(DashboardServer&&) = delete;

  /// URL for the browser, including the token.
  const std::string& url() const noexcept;
  int watchers() const noexcept;
  /// Waits until every watcher has left, at most for `longest`. A page leaves after a state "ended".
  void finish(std::chrono::milliseconds longest);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stageid
