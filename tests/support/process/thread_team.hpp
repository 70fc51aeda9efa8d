#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "excitation/threads/team.hpp"

namespace stageid::test {

/// Messages between the threads of teams, in the order in which they were sent.
class Mailboxes {
 public:
  void put(int from, int to, std::span<const std::byte> bytes) {
    const std::lock_guard lock(mutex_);
    boxes_[{from, to}].emplace_back(bytes.begin(), bytes.end());
    arrived_.notify_all();
  }
  std::vector<std::byte> take(int from, int to) {
    std::unique_lock lock(mutex_);
    auto& box = boxes_[{from, to}];
    arrived_.wait(lock, [&] { return !box.empty(); });
    std::vector<std::byte> bytes = std::move(box.front());
    box.pop_front();
    return bytes;
  }

 private:
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::map<std::pair<int, int>, std::deque<std::vector<std::byte>>> boxes_;
};

/// A team whose processes are threads.
class ThreadTeam : public Team {
 public:
  ThreadTeam(int rank, int size, Mailboxes& mail) : Team(rank, size), mail_(mail) {}

 private:
  void deliver(int to, std::span<const std::byte> bytes) const override {
    mail_.put(rank(), to, bytes);
  }
  void receive(int from, std::span<std::byte> bytes) const override {
    const std::vector<std::byte> sent = mail_.take(from, rank());
    if (sent.size() != bytes.size()) std::terminate();  // the threads do not do the same
    std::copy(sent.begin(), sent.end(), bytes.begin());
  }

  Mailboxes& mail_;
};

/// Calls work(team) in every process of a team.
inline void run_team(int size, const std::function<void(const Team&)>& work) {
  Mailboxes mail;
  std::vector<std::jthread> threads;
  for (int rank = 0; rank < size; ++rank)
    threads.emplace_back([&, rank] { work(ThreadTeam(rank, size, mail)); });
}

}  // namespace stageid::test
