#include "acquisition/loop/log_thread.hpp"

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "hal/stage/pacer.hpp"
#include "hal/stage/real_time.hpp"

namespace stageid {

namespace {

constexpr std::size_t kBlockRows = 2048;
constexpr std::int64_t kLongestDelay_ns = 500'000'000;  // until a partial block is written
constexpr std::int64_t kSynchronizeEvery_ns = 1'000'000'000;
constexpr std::chrono::microseconds kPause{500};

}  // namespace

LogThread::LogThread(RunWriter& log, SampleRing& ring, std::vector<RunObserver*> observers)
    : log_(log),
      ring_(ring),
      observers_(std::move(observers)),
      last_write_ns_(monotonic_ns()),
      last_synchronize_ns_(last_write_ns_) {
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void LogThread::begin_run(LogRun run, Eigen::MatrixXd excitation) {
  unconfirmed_.store(true, std::memory_order_relaxed);
  queue({ring_.pushed(), std::move(run), std::move(excitation)});
}

void LogThread::forget_run() {
  const std::lock_guard lock(mutex_);
  commands_.pop_back();
  unconfirmed_.store(false, std::memory_order_relaxed);
}

void LogThread::end_run(LogRun run) { queue({ring_.pushed(), std::move(run), std::nullopt}); }

void LogThread::queue(Command command) {
  const std::lock_guard lock(mutex_);
  commands_.push_back(std::move(command));
}

void LogThread::drain() {
  std::unique_lock lock(mutex_);
  written_.wait(lock, [this] { return commands_.empty() && ring_.popped() == ring_.pushed(); });
}

std::string LogThread::error() const {
  const std::lock_guard lock(mutex_);
  return error_;
}

void LogThread::run(const std::stop_token& stop) noexcept {
  take_normal_priority();
  while (true) {
    // Read first, so that everything queued before it is still written.
    const bool stopping = stop.stop_requested();
    if (work(stopping)) continue;
    {
      const std::lock_guard lock(mutex_);
      written_.notify_all();
    }
    if (stopping && ring_.popped() == ring_.pushed()) return;
    std::this_thread::sleep_for(kPause);
  }
}

/// Writes one block or executes one command. @returns false if there is nothing to do
bool LogThread::work(bool stop) {
  std::optional<Command> next;
  std::uint64_t limit = ring_.pushed();
  {
    const std::lock_guard lock(mutex_);
    if (!commands_.empty()) {
      limit = std::min(limit, commands_.front().at_row);
      const bool wait = commands_.size() == 1 && commands_.front().excitation &&
                        unconfirmed_.load(std::memory_order_acquire);
      if (ring_.popped() == limit && commands_.front().at_row == limit && !wait)
        next = std::move(commands_.front());
    }
  }
  if (next) {
    execute(*next);
    const std::lock_guard lock(mutex_);
    commands_.pop_front();
    return true;
  }
  const std::int64_t now = monotonic_ns();
  if (now - last_synchronize_ns_ > kSynchronizeEvery_ns) {
    guarded([this] { log_.synchronize(); });
    last_synchronize_ns_ = monotonic_ns();
  }
  bool all = now - last_write_ns_ > kLongestDelay_ns;
  {
    const std::lock_guard lock(mutex_);
    all |= stop || !commands_.empty();
  }
  return write_rows(limit - ring_.popped(), all);
}

bool LogThread::write_rows(std::uint64_t available, bool all) {
  if (available == 0 || (available < kBlockRows && !all)) return false;
  const std::span<const double> rows =
      ring_.front(static_cast<std::size_t>(std::min<std::uint64_t>(available, kBlockRows)));
  guarded([&] { log_.write(rows); });
  for (RunObserver* observer : observers_) observer->rows(rows, ring_.row_words());
  ring_.pop(rows.size() / ring_.row_words());
  last_write_ns_ = monotonic_ns();
  return true;
}

void LogThread::execute(const Command& command) {
  guarded([&] {
    if (command.excitation) {
      log_.begin_run(command.run, *command.excitation);
    } else {
      log_.end_run(command.run);
      log_.synchronize();
      complete_runs_.fetch_add(command.run.complete ? 1 : 0, std::memory_order_relaxed);
    }
  });
  last_synchronize_ns_ = monotonic_ns();
  for (RunObserver* observer : observers_) {
    if (command.excitation) {
      observer->begin_run(command.run);
    } else {
      observer->end_run(command.run);
    }
  }
}

template <typename Action>
void LogThread::guarded(Action action) noexcept {
  if (failed()) return;
  try {
    action();
  } catch (const std::exception& error) {
    const std::lock_guard lock(mutex_);
    error_ = error.what();
    failed_.store(true, std::memory_order_relaxed);
  }
}

}  // namespace stageid
