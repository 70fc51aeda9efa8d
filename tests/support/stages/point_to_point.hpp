#pragma once

#include <cstdint>

#include "tests/support/process/random_numbers.hpp"

namespace stageid::test {

/// A motion that never repeats: moves to random places within +- stroke, with rests between them. Position, velocity and
/// acceleration are continuous.
class PointToPoint {
 public:
  PointToPoint(double stroke_m, double sample_rate_hz, std::uint64_t seed)
      : stroke_m_(stroke_m), sample_rate_hz_(sample_rate_hz), random_(seed) {}

  /// The position at the next sample, m.
  double next() {
    if (++sample_ > moving_ + resting_) plan();
    const double t = sample_ < moving_ ? static_cast<double>(sample_) / moving_ : 1.0;
    return from_m_ + (to_m_ - from_m_) * t * t * t * (10.0 - 15.0 * t + 6.0 * t * t);
  }

 private:
  void plan() {
    from_m_ = to_m_;
    to_m_ = random_.uniform(-stroke_m_, stroke_m_);
    moving_ = static_cast<int>(random_.uniform(0.2, 0.5) * sample_rate_hz_);
    resting_ = static_cast<int>(random_.uniform(0.0, 0.3) * sample_rate_hz_);
    sample_ = 0;
  }

  double stroke_m_;
  double sample_rate_hz_;
  RandomNumbers random_;
  double from_m_ = 0.0;
  double to_m_ = 0.0;
  int moving_ = 0;
  int resting_ = 0;
  int sample_ = 0;
};

}  // namespace stageid::test
