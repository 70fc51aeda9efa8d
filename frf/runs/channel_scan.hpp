#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>

namespace stageid {

/// The two largest distinct values that occurred, and how often.
struct Extreme {
  double value = -std::numeric_limits<double>::infinity();
  double next = -std::numeric_limits<double>::infinity();
  std::uint64_t count = 0;
  std::uint64_t next_count = 0;

  void add(double v, std::uint64_t times = 1) noexcept;
  void add(const Extreme& other) noexcept;
};

/// What the samples of one channel look like in time.
class ChannelScan {
 public:
  /// `driven`: per sample, whether what drives the channel differs from the sample before; null: at
  /// every sample. A channel that shows one value while its drive does is not stuck.
  void add(const Eigen::Ref<const Eigen::VectorXd>& samples, const char* driven = nullptr) noexcept;
  /// The channel was not driven in the run just added: what it showed says nothing.
  void forget_constant() noexcept { longest_driven_ = 0; }
  /// The next samples follow no earlier ones: another run, or a gap.
  void break_off() noexcept { stretch_ = 0; }
  void add(const ChannelScan& other) noexcept;

  std::uint64_t samples() const noexcept { return samples_; }
  /// The most driven samples in a row of equal ones.
  std::uint64_t longest_constant() const noexcept { return longest_driven_; }
  const Extreme& high() const noexcept { return high_; }
  Extreme low() const noexcept;  ///< of the negated samples, with their sign back

  /// Whether it leaves an end of its range and comes back to it: no channel does that is stuck.
  bool returns() const noexcept;

  /// ln p of the hypothesis that the channel is not clipped. The density of an excited channel falls
  /// towards its ends, so that of the n = count + next_count samples on the two outermost values at
  /// most half lie on the outermost one; clipped samples pile up there:
  ///   p <= P(B(n, 1/2) >= count) <= exp(-n KL(count / n, 1/2))   (Chernoff).
  double log_p_high() const noexcept;
  double log_p_low() const noexcept;

 private:
  void add_some(const Eigen::Ref<const Eigen::VectorXd>& samples, const char* driven) noexcept;

  Extreme high_;
  Extreme low_;  // of the negated samples
  std::uint64_t samples_ = 0;
  std::uint64_t stretch_ = 0;
  std::uint64_t driven_ = 0;  // of the stretch
  std::uint64_t longest_ = 0;
  std::uint64_t longest_driven_ = 0;
  double last_ = 0.0;
};

}  // namespace stageid
