#pragma once

#include <cstdint>
#include <random>

namespace stageid {

inline constexpr std::uint64_t kSplitMix64Increment = 0x9E3779B97F4A7C15U;

/// The finalizer of SplitMix64, a bijection of 64-bit words that mixes every bit into every other.
/// Source: G. Steele, D. Lea, C. Flood, Fast splittable pseudorandom number generators (2014);
/// constants as in S. Vigna's splitmix64.c.
constexpr std::uint64_t splitmix64(std::uint64_t word) noexcept {
  word += kSplitMix64Increment;
  word = (word ^ (word >> 30U)) * 0xBF58476D1CE4E5B9U;
  word = (word ^ (word >> 27U)) * 0x94D049BB133111EBU;
  return word ^ (word >> 31U);
}

/// Seed of the stream (first, second) below `seed`:
///   splitmix64(splitmix64(splitmix64(seed) + first) + second), modulo 2^64.
/// Streams of neighbouring seeds and indices are unrelated, unlike mt19937_64(seed + index).
constexpr std::uint64_t stream_seed(std::uint64_t seed, std::uint64_t first,
                                    std::uint64_t second) noexcept {
  return splitmix64(splitmix64(splitmix64(seed) + first) + second);
}

/// Random numbers that are the same on every machine: the standard specifies std::mt19937_64 bit by bit,
/// but not std::uniform_real_distribution.
class UniformStream {
 public:
  explicit UniformStream(std::uint64_t seed) : engine_(seed) {}

  /// Uniform on [0, 1), the upper 53 bits of one draw.
  double next() { return static_cast<double>(engine_() >> 11U) * 0x1p-53; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace stageid
