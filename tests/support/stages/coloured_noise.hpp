#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "excitation/words/words.hpp"
#include "hal/simulator/noise.hpp"

namespace stageid {

/// Spectra of disturbances of real stages.
enum class NoiseColour : std::uint8_t {
  white,    ///< flat up to half the sample rate
  flicker,  ///< 1/f in power
  drift,    ///< a random walk, 1/f^2 in power
  resonant  ///< of a lightly damped structure beside the stage
};
template <>
inline constexpr std::array kWords<NoiseColour> = {"white", "flicker", "drift", "resonant"};

struct ColouredNoiseSpec {
  NoiseColour colour = NoiseColour::white;
  Eigen::Index channels = 0;
  double sample_rate_hz = 0.0;
  /// Power spectral density of every channel at reference_hz, one-sided, unit^2/Hz.
  double density = 0.0;
  double reference_hz = 1.0;    ///< resonant: the natural frequency
  double damping_ratio = 0.01;  ///< resonant
};

/// Independent noise of one colour on several channels, sample by sample. White, flicker and resonant noise start
/// in their stationary state, drift starts at zero.
class ColouredNoise {
 public:
  /// @throws std::invalid_argument unless rate and reference are positive and the reference is below half the rate.
  explicit ColouredNoise(const ColouredNoiseSpec& spec);

  void restart(std::uint64_t seed, std::uint64_t stream) noexcept;
  /// Draws the next sample. Does not allocate. @returns one number per channel, valid until the next call
  const Eigen::ArrayXd& next() noexcept;

 private:
  void draw() noexcept;

  ColouredNoiseSpec spec_;
  NormalSource source_{0, 0};
  Eigen::ArrayXd numbers_;  // of one sample, padded to complete blocks
  Eigen::ArrayXd pole_;     // flicker: one per octave
  Eigen::ArrayXd drive_;    // gain of the new random numbers, one per state of a channel
  Eigen::ArrayXXd state_;   // channels x states
  double radius_ = 0.0;     // resonant: of the poles
  double turn_ = 0.0;       // resonant: 2 radius cos(angle)
  Eigen::ArrayXd value_;
};

}  // namespace stageid
