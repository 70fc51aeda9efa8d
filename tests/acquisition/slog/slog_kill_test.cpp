#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <new>
#include <random>
#include <thread>

#include "acquisition/formats/open_log.hpp"
#include "acquisition/slog/slog_reader.hpp"
#include "tests/acquisition/record/small_log.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_slog_kill {

using Counter = std::atomic<std::uint64_t>;
static_assert(Counter::is_always_lock_free);

constexpr std::uint64_t kRunRows = 12 * 5000;

/// Writes runs until it is killed; acknowledged rows are counted over all of them.
[[noreturn]] void write_until_killed(const std::filesystem::path& file, std::uint64_t block_rows,
                                     Counter& acknowledged) {
  SlogWriter log = SlogWriter::create(file, test::small_info());
  for (std::size_t run = 0;; ++run) {
    log.begin_run(test::run_of(run), test::excitation_of(run));
    for (std::uint64_t first = 0; first < kRunRows; first += block_rows) {
      log.write(test::rows_of(run, first, std::min(block_rows, kRunRows - first)));
      acknowledged.store(log.acknowledged_rows());
    }
    log.end_run(test::run_of(run));
  }
}

std::uint64_t intact_rows(const std::filesystem::path& file) {
  return test::good_rows(*open_log(file, false));
}

TEST(SlogKill, EveryAcknowledgedRowOutlivesTheProcess) {
  // Shared with the children, so that it outlives them.
  void* const memory =
      ::mmap(nullptr, sizeof(Counter), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  std::mt19937 engine(11);
  int with_rows = 0;
  for (int attempt = 0; attempt < 20; ++attempt) {
    const test::TemporaryDirectory directory;
    const auto file = directory / "a.slog";
    Counter& acknowledged = *new (memory) Counter(0);
    const std::uint64_t block_rows = attempt % 2 == 0 ? 5 : 997;
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) write_until_killed(file, block_rows, acknowledged);
    while (acknowledged.load() == 0) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::microseconds(engine() % 40'000));
    ::kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status));

    const std::uint64_t promised = acknowledged.load();
    const std::uint64_t there = intact_rows(file);
    ASSERT_GE(there, promised);
    ASSERT_LE(there, promised + block_rows) << "one block may be written and not yet counted";
    with_rows += promised > 0 ? 1 : 0;

    // The log can be continued.
    SlogWriter log = SlogWriter::resume(file, test::small_info());
    log.close(0, "");
    ASSERT_EQ(intact_rows(file), there);
  }
  EXPECT_EQ(with_rows, 20);
  ::munmap(memory, sizeof(Counter));
}

}  // namespace stageid::test_slog_kill
