#pragma once

#include <fftw3.h>

#include <mutex>

namespace stageid {

/// How FFTW plans in this program. Its planner has global state and must be entered by one thread at
/// a time; executing a plan need not.
struct FftPlanner {
  std::mutex lock;
  /// Never FFTW_MEASURE unless asked for (fft_wisdom.hpp): it picks among algorithms by timing them,
  /// so the rounding of the result, and with it the bytes of our files, would change from run to run.
  unsigned flags = FFTW_ESTIMATE;
};

inline FftPlanner& fft_planner() {
  static FftPlanner planner;
  return planner;
}

}  // namespace stageid
