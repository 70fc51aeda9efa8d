#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "tools/dashboard/dashboard_address.hpp"
#include "tools/dashboard/latest_text.hpp"

namespace stageid {

/// What the dashboard shows and may do.
struct DashboardContent {
  std::string page;                       ///< HTML
  LatestText state;                       ///< one JSON object a line: the stream
  LatestText response;                    ///< JSON of the newest FRF
  std::function<void()> abort;            ///< asked for by a watcher; must not wait
  std::function<void()> watched = [] {};  ///< somebody began to watch
};

/// Serves a page, the stream of its state (server-sent events), the newest response, and takes the
/// order to abort:
///   GET /   GET /events   GET /response.json   POST /abort
///
/// Threads of its own of low priority; at most kWatchers streams at once (then 503). A watcher gets
/// the newest state when it is ready to read: nothing is queued for a slow one, and one that does
/// not read for kPatience_s is let go. The program's other threads never wait for any of it.
///
/// Where other machines can reach it a token is asked for (?token=...). On loopback only requests
/// that name this machine are answered, and may watch without. To abort takes the token everywhere,
/// and a page of ours (a header that other sites cannot set), so that no web page elsewhere can use
/// the user's browser for it. Requests are short: a body above kLargestBody is refused.
class DashboardServer {
 public:
  static constexpr int kWatchers = 32;
  static constexpr int kPatience_s = 2;
  static constexpr std::size_t kLargestBody = 1024;

  /// Listens, and serves from now on. `content` must outlive the server.
  /// @throws StageError if the address cannot be had: says why and what to do.
  DashboardServer(const DashboardAddress& address, DashboardContent& content);
  ~DashboardServer();
  DashboardServer(const DashboardServer&) = delete;
  DashboardServer& operator=(const DashboardServer&) = delete;

  /// To open in a browser, the token in it.
  const std::string& url() const noexcept;
  int watchers() const noexcept;
  /// Waits until every watcher has left, but no longer than this: a page leaves when it has seen a
  /// state that says "ended".
  void finish(std::chrono::milliseconds longest);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stageid
