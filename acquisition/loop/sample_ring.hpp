#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "excitation/words/require.hpp"

namespace stageid {

/// A lock-free ring of rows of fixed size between one producer (the loop) and one consumer (another thread).
/// The constructor allocates and touches all memory.
///
/// Each side keeps a copy of the other's counter and reads the shared one only if the copy indicates full or
/// empty. The cache line therefore moves between cores once per batch instead of once per row.
template <typename Word>
class RowRing {
 public:
  /// `capacity_rows` is rounded up to a power of two.
  /// @throws std::invalid_argument if either is zero.
  RowRing(std::size_t row_words, std::size_t capacity_rows)
      : row_words_(row_words), capacity_(std::bit_ceil(capacity_rows)) {
    require(row_words > 0 && capacity_rows > 0,
            "sample ring: rows and capacity must be at least 1");
    words_.assign(row_words_ * capacity_, {});
  }

  std::size_t row_words() const noexcept { return row_words_; }
  std::size_t capacity_rows() const noexcept { return capacity_; }

  // Producer -------------------------------------------------------------------------------

  /// The next row to fill, or nullptr if the ring is full. The same row until commit().
  Word* reserve() noexcept {
    const std::uint64_t pushed = pushed_.load(std::memory_order_relaxed);
    if (pushed - popped_seen_ >= capacity_) {
      popped_seen_ = popped_.load(std::memory_order_acquire);
      if (pushed - popped_seen_ >= capacity_) return nullptr;
    }
    return words_.data() + (pushed & (capacity_ - 1)) * row_words_;
  }

  /// Passes the reserved row to the consumer.
  void commit() noexcept {
    pushed_.store(pushed_.load(std::memory_order_relaxed) + 1, std::memory_order_release);
  }

  /// Rows committed since construction; from any thread.
  std::uint64_t pushed() const noexcept { return pushed_.load(std::memory_order_acquire); }

  // Consumer -------------------------------------------------------------------------------

  /// Up to `rows` of the oldest rows, contiguous in memory, valid until pop(). Fewer are returned where the ring
  /// wraps around.
  std::span<const Word> front(std::size_t rows) noexcept {
    const std::uint64_t popped = popped_.load(std::memory_order_relaxed);
    if (pushed_seen_ - popped < rows) pushed_seen_ = pushed_.load(std::memory_order_acquire);
    const std::size_t first = popped & (capacity_ - 1);
    const auto there = static_cast<std::size_t>(pushed_seen_ - popped);
    const std::size_t count = std::min({rows, there, capacity_ - first});
    return {words_.data() + first * row_words_, count * row_words_};
  }

  /// Returns `rows` of the oldest rows to the producer.
  void pop(std::size_t rows) noexcept {
    popped_.store(popped_.load(std::memory_order_relaxed) + rows, std::memory_order_release);
  }

  /// Rows popped since construction; from any thread.
  std::uint64_t popped() const noexcept { return popped_.load(std::memory_order_acquire); }

 private:
  static constexpr std::size_t kCacheLine = 64;

  std::size_t row_words_;
  std::size_t capacity_;
  std::vector<Word> words_;
  alignas(kCacheLine) std::atomic<std::uint64_t> pushed_ = 0;
  std::uint64_t popped_seen_ = 0;  // the producer's copy
  alignas(kCacheLine) std::atomic<std::uint64_t> popped_ = 0;
  std::uint64_t pushed_seen_ = 0;  // the consumer's copy
};

/// Rows of a log, from the loop to the log thread.
using SampleRing = RowRing<double>;

}  // namespace stageid
