#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>

#include "frf/runs/value_grid.hpp"

namespace stageid {

/// The two largest distinct values and their counts.
struct Extreme {
  double value = -std::numeric_limits<double>::infinity();
  double next = -std::numeric_limits<double>::infinity();
  std::uint64_t count = 0;
  std::uint64_t next_count = 0;

  void add(double v, std::uint64_t times = 1) noexcept;
  void add(const Extreme& other) noexcept;
};

/// Statistics of the samples of one channel in time.
class ChannelScan {
 public:
  /// `driven`: per sample, whether the channel's drive differs from the previous sample; null: at every sample. A
  /// channel that is constant while its drive is constant is not stuck.
  void add(const Eigen::Ref<const Eigen::VectorXd>& samples, const char* driven = nullptr) noexcept;
  /// Ignores repeated values: the channel was not driven in the run just added.
  void forget_constant() noexcept { longest_driven_ = 0; }
  /// Separates the next samples from the previous ones: another run, or a gap.
  void break_off() noexcept { stretch_ = 0; }
  void add(const ChannelScan& other) noexcept;

  std::uint64_t samples() const noexcept { return samples_; }
  /// The largest number of driven samples in a sequence of equal ones.
  std::uint64_t longest_constant() const noexcept { return longest_driven_; }
  /// Length that the longest sequence of equal samples has if each repeats the previous one with the same probability p,
  /// as behind a coarse converter: ln(number of sequences) / ln(1 / p).
  double expected_constant() const noexcept;
  /// Whether a coarse converter repeats values: n p^2 > 1 sequences of three equal samples are expected, where p is the
  /// share of the n sequences that are longer than one sample and end by a change. A stuck channel has few of them.
  bool is_coarse() const noexcept { return repeating_ * repeating_ > stretches_; }
  /// Of the converter behind the channel; 0 if its values have none (ValueGrid).
  double step() const noexcept { return grid_.step(); }
  const Extreme& high() const noexcept { return high_; }
  Extreme low() const noexcept;  ///< of the negated samples, with the original sign

  /// Whether it leaves an end of its range and returns to it, which a stuck channel does not do.
  bool returns() const noexcept;

  /// ln p of the hypothesis that the channel is not clipped. The density of an excited channel decreases towards its
  /// ends. Of the n = count + next_count samples on the two outermost values, at most half are then expected on the
  /// outermost one; clipped samples accumulate there:
  ///   p <= P(B(n, 1/2) >= count) <= exp(-n KL(count / n, 1/2))   (Chernoff).
  double log_p_high() const noexcept;
  double log_p_low() const noexcept;

 private:
  void add_some(const Eigen::Ref<const Eigen::VectorXd>& samples, const char* driven) noexcept;

  Extreme high_;
  Extreme low_;  // of the negated samples
  ValueGrid grid_;
  std::uint64_t samples_ = 0;
  std::uint64_t stretches_ = 0;
  std::uint64_t repeating_ = 0;  // of them, longer than one sample and ended by a change
  std::uint64_t stretch_ = 0;
  std::uint64_t driven_ = 0;  // within the current sequence
  std::uint64_t longest_ = 0;
  std::uint64_t longest_driven_ = 0;
  double last_ = 0.0;
};

}  // namespace stageid
