#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>

namespace stageid {

/// Independent standard normal numbers, fast and reproducible from (seed, stream).
///
/// Eight xoshiro256++ generators in parallel (D. Blackman and S. Vigna, Scrambled linear pseudorandom number
/// generators, 2021) and the Box-Muller transform. Logarithm, sine and cosine are polynomials, so that all
/// operations are vector arithmetic without branches.
class NormalSource {
 public:
  static constexpr std::size_t kLanes = 8;
  static constexpr std::size_t kBlock = 2 * kLanes;

  NormalSource(std::uint64_t seed, std::uint64_t stream) noexcept;
  /// Writes `blocks` times kBlock numbers.
  void fill(double* out, std::size_t blocks) noexcept;

 private:
  void next_bits(std::uint64_t* out) noexcept;

  std::array<std::array<std::uint64_t, kLanes>, 4> state_;
};

struct NoiseSpec {
  Eigen::Index actuators = 0;
  Eigen::Index sensors = 0;
  double sample_rate_hz = 0.0;
  double force_n = 0.0;            ///< rms, white from sample to sample
  double sensor_m = 0.0;           ///< rms of the white part
  double sensor_coloured_m = 0.0;  ///< rms of the coloured part
  double sensor_corner_hz = 1.0;   ///< of its first-order low pass
};

/// Disturbances of a stage, sample by sample: forces, and white plus coloured sensor noise. The coloured part
/// starts in its stationary state. Switching one kind on or off does not change the numbers of another.
class StageNoise {
 public:
  explicit StageNoise(const NoiseSpec& spec);

  void restart(std::uint64_t seed, std::uint64_t stream) noexcept;
  /// Draws the next sample. Does not allocate.
  void next() noexcept;
  /// Of the current sample: size actuators, size sensors.
  const double* force_n() const noexcept { return force_.data(); }
  const double* sensor_m() const noexcept { return sensor_.data(); }
  double* sensor_m() noexcept { return sensor_.data(); }

 private:
  const double* row() noexcept;

  NoiseSpec spec_;
  bool silent_ = false;
  double pole_ = 0.0;
  double drive_m_ = 0.0;
  NormalSource source_{0, 0};
  std::size_t stride_ = 0;  // numbers per sample, padded
  std::size_t next_row_ = 0;
  Eigen::ArrayXd numbers_;
  Eigen::ArrayXd force_;
  Eigen::ArrayXd coloured_;
  Eigen::ArrayXd sensor_;
};

}  // namespace stageid
