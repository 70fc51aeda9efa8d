#include "tools/dashboard/dashboard_server.hpp"

#include <fmt/format.h>
#include <httplib.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <thread>

#include "hal/stage/stage.hpp"
#include "tools/dashboard/metrics.hpp"

namespace stageid {
namespace {

using namespace std::chrono_literals;

constexpr int kNice = 10;
constexpr int kOtherThreads = 8;  // besides those of the streams: pages, responses, the abort
constexpr auto kKeepAlive = 250ms;
constexpr int kKeepAlive_ms = 1000;  // until the next request of a connection
// While connections wait for a thread, so that silent ones cannot keep the abort from its turn.
constexpr int kBusyKeepAlive_ms = 50;
constexpr auto kBusyPatience = 250ms;
constexpr std::size_t kLargestHead = std::size_t{1}
                                     << 14;  // with the cookies of other servers here
constexpr const char* kPageHeader = "X-Stageid";

/// Not those of httplib, which let two programs share a port.
void set_socket_options(int socket) {
  const int yes = 1;
  ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
}

constexpr std::chrono::milliseconds kPatience = std::chrono::seconds{DashboardServer::kPatience_s};

constexpr const char* kWholeAddress = "open the address printed by stageid, with its token";

void answer(httplib::Response& response, int status, const std::string& why) {
  response.status = status;
  response.set_content(why + "\n", "text/plain");
}

std::string host_in_url(const std::string& host) {
  return host.find(':') == std::string::npos ? host : "[" + host + "]";
}

}  // namespace

/// One request of a client, with a deadline and a largest size for its header and body. httplib limits the time between
/// two pieces only, so a few clients that send a byte now and then would occupy all threads, and keeps lines and bodies
/// of any length.
class PatientStream final : public httplib::Stream {
 public:
  PatientStream(int socket, std::chrono::milliseconds patience)
      : socket_(socket), deadline_(Clock::now() + patience) {}
  void request_is_read() { deadline_ = Clock::time_point::max(); }

  bool is_readable() const override { return ready(POLLIN); }
  bool is_writable() const override { return ready(POLLOUT); }
  ssize_t read(char* data, std::size_t size) override {
    const ssize_t got =
        left_ > 0 && is_readable() ? ::recv(socket_, data, std::min(size, left_), 0) : -1;
    if (got > 0) left_ -= static_cast<std::size_t>(got);
    return got;
  }
  bool is_exhausted() const { return left_ == 0; }

  ssize_t write(const char* data, std::size_t size) override {
    return is_writable() ? ::send(socket_, data, size, MSG_NOSIGNAL) : -1;
  }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return socket_; }

 private:
  using Clock = std::chrono::steady_clock;

  bool ready(short events) const {
    const auto until = std::min(deadline_, Clock::now() + kPatience);
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now());
    pollfd wanted{socket_, events, 0};
    return left.count() > 0 && ::poll(&wanted, 1, static_cast<int>(left.count())) > 0;
  }

  int socket_;
  std::size_t left_ = kLargestHead + DashboardServer::kLargestBody;
  Clock::time_point deadline_;
};

/// Counts the connections that wait for a thread.
class CountingPool final : public httplib::TaskQueue {
 public:
  CountingPool(std::size_t threads, std::atomic<int>& waiting)
      : waiting_(waiting), pool_(threads) {}
  void enqueue(std::function<void()> task) override {
    ++waiting_;
    pool_.enqueue([this, task = std::move(task)] {
      --waiting_;
      task();
    });
  }
  void shutdown() override { pool_.shutdown(); }

 private:
  std::atomic<int>& waiting_;
  httplib::ThreadPool pool_;
};

/// Patient with a client only while no other waits for its thread.
class PatientServer final : public httplib::Server {
 public:
  explicit PatientServer(std::size_t threads) {
    new_task_queue = [this, threads] { return new CountingPool(threads, waiting_); };
  }
  /// For a bound server. httplib lets five connections wait: others repeat theirs after seconds.
  void let_many_wait() { ::listen(svr_sock_, SOMAXCONN); }

 private:
  bool process_and_close_socket(socket_t socket) override {
    bool good = true;
    bool closed = false;
    for (auto left = keep_alive_max_count_; good && !closed && left > 0; --left) {
      pollfd next{socket, POLLIN, 0};
      const int keep_alive_ms = waiting_ > 0 ? kBusyKeepAlive_ms : kKeepAlive_ms;
      if (svr_sock_ == INVALID_SOCKET || ::poll(&next, 1, keep_alive_ms) <= 0) break;
      PatientStream stream(socket, waiting_ > 0 ? kBusyPatience : kPatience);
      good = process_request(stream, left == 1, closed, [&stream](httplib::Request& request) {
        request.ranges.clear();  // each would be a copy of the page
        if (request.method == "GET") stream.request_is_read();
      });
      good = good && !stream.is_exhausted();  // what follows is the rest of this request
    }
    ::shutdown(socket, SHUT_RDWR);
    ::close(socket);
    return good;
  }

  std::atomic<int> waiting_ = 0;
};

struct DashboardServer::State {
  State(const DashboardAddress& asked, DashboardContent& shown)
      : address(asked), content(shown), token(make_token()) {}

  DashboardAddress address;
  DashboardContent& content;
  std::string token;
  std::string url;
  PatientServer server{kWatchers + kOtherThreads};
  std::thread thread;
  std::atomic<int> watchers = 0;
  std::atomic<bool> finishing = false;

  bool has_token(const httplib::Request& request) const {
    return same_token(request.get_param_value("token"), token);
  }

  /// A request of our page, not of another one in the same browser.
  bool from_page(const httplib::Request& request, const char* what) const {
    return has_token(request) && request.get_header_value(kPageHeader) == what;
  }

  bool allowed(const httplib::Request& request) const {
    if (content.secret && !has_token(request)) return false;
    if (!address.is_loopback()) return has_token(request);
    const std::string host = request.get_header_value("Host");
    const std::string mine = fmt::format("{}:{}", host_in_url(address.host), address.port);
    return host == mine || host == fmt::format("localhost:{}", address.port) ||
           host == fmt::format("127.0.0.1:{}", address.port);
  }

  void listen() {
    server.set_socket_options(set_socket_options);
    server.set_tcp_nodelay(true);
    server.set_payload_max_length(kLargestBody);
    errno = 0;
    if (address.port == 0) {
      address.port = server.bind_to_any_port(address.host);
    } else if (!server.bind_to_port(address.host, address.port)) {
      address.port = -1;
    }
    if (address.port > 0) {
      server.let_many_wait();
      return;
    }
    const std::string why = errno != 0 ? std::strerror(errno) : "no such address";
    throw StageError(
        fmt::format("{}: cannot listen on {} ({}); use another port, or 0 for any free one",
                    address.flag, address.host, why));
  }

  /// Rejects requests that are not allowed before any other processing.
  void route() {
    server.set_pre_routing_handler(
        [this](const httplib::Request& request, httplib::Response& response) {
          response.set_header("Cache-Control", "no-store");
          response.set_header("X-Content-Type-Options", "nosniff");
          response.set_header("Referrer-Policy", "no-referrer");
          if (allowed(request)) return httplib::Server::HandlerResponse::Unhandled;
          answer(response, 403, kWholeAddress);
          return httplib::Server::HandlerResponse::Handled;
        });
    server.set_error_handler([](const httplib::Request& request, httplib::Response& response) {
      if (!response.body.empty()) return;
      if (response.status == 404)
        answer(response, 404, fmt::format("{}: not found; open /", request.path));
      else if (response.status == 413)
        answer(response, 413, fmt::format("body too large; at most {} bytes", kLargestBody));
      else
        answer(response, response.status, "bad request; open the address printed by stageid");
    });
    server.Get("/", [this](const httplib::Request&, httplib::Response& response) {
      response.set_content(content.page, "text/html; charset=utf-8");
    });
    server.Get("/events",
               [this](const httplib::Request&, httplib::Response& response) { stream(response); });
    server.Get("/response.json", [this](const httplib::Request&, httplib::Response& response) {
      const LatestText::Edition edition = content.response.get();
      if (edition.number == 0) {
        answer(response, 404, "no response yet; wait for the first complete realization");
      } else {
        response.set_content(*edition.text, "application/json");
      }
    });
    server.Get("/watch.json", [this](const httplib::Request&, httplib::Response& response) {
      response.set_content(content.history(), "application/json");
    });
    server.Get("/trace.json", [this](const httplib::Request& request, httplib::Response& response) {
      const std::string text = request.get_param_value("channel");
      int channel = -1;
      std::from_chars(text.data(), text.data() + text.size(), channel);
      response.set_content(content.trace(channel), "application/json");
    });
    server.Get("/metrics", [this](const httplib::Request&, httplib::Response& response) {
      const LatestText::Edition edition = content.state.get();
      response.set_content(edition.number > 0 ? metrics_text(*edition.text) : "",
                           "text/plain; version=0.0.4; charset=utf-8");
    });
    server.Post("/abort", [this](const httplib::Request& request, httplib::Response& response) {
      if (!from_page(request, "abort")) return answer(response, 403, kWholeAddress);
      content.abort();
      response.set_content("stopping\n", "text/plain");
    });
    if (!content.act) return;
    server.Post("/act", [this](const httplib::Request& request, httplib::Response& response) {
      if (!from_page(request, "act")) return answer(response, 403, kWholeAddress);
      const ActionReply reply = content.act(request.body);
      answer(response, reply.status, reply.text);
    });
  }

  void stream(httplib::Response& response) {
    if (watchers.fetch_add(1) >= kWatchers) {
      watchers.fetch_sub(1);
      answer(response, 503, fmt::format("{} pages are already open; close one", kWatchers));
      return;
    }
    content.watched();
    response.set_chunked_content_provider(
        "text/event-stream",
        [this, seen = std::uint64_t{0}](std::size_t, httplib::DataSink& sink) mutable {
          return feed(seen, sink);
        },
        [this](bool) { watchers.fetch_sub(1); });
  }

  /// Sends one piece of the stream; false ends it.
  bool feed(std::uint64_t& seen, httplib::DataSink& sink) {
    const bool last = finishing;
    const LatestText::Edition edition = content.state.wait(seen, last ? 0ms : kKeepAlive);
    // An SSE comment detects whether the watcher is still connected.
    std::string text = ":\n\n";
    if (edition.number > seen) text = fmt::format("data: {}\n\n", *edition.text);
    seen = edition.number;
    if (!sink.write(text.data(), text.size())) return false;
    if (last) sink.done();
    return true;
  }
};

DashboardServer::DashboardServer(const DashboardAddress& address, DashboardContent& content)
    : state_(std::make_unique<State>(address, content)) {
  State& state = *state_;
  state.listen();
  state.route();
  state.url = fmt::format("http://{}:{}/?token={}", host_in_url(state.address.host),
                          state.address.port, state.token);
  state.thread = std::thread([&state] {
    // A measurement goes first. The threads that this one starts inherit its priority.
    if (!state.content.act) ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
    state.server.listen_after_bind();
  });
  while (!state.server.is_running()) std::this_thread::yield();  // an earlier stop() would be lost
}

DashboardServer::~DashboardServer() {
  state_->finishing = true;
  state_->server.stop();
  state_->thread.join();
}

const std::string& DashboardServer::url() const noexcept { return state_->url; }

int DashboardServer::watchers() const noexcept { return state_->watchers; }

void DashboardServer::finish(std::chrono::milliseconds longest) {
  const auto until = std::chrono::steady_clock::now() + longest;
  while (watchers() > 0 && std::chrono::steady_clock::now() < until)
    std::this_thread::sleep_for(10ms);
}

}  // namespace stageid
