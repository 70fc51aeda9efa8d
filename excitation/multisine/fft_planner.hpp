#pragma once

#include <fftw3.h>

#include <mutex>

namespace stageid {

/// The lock and the flags of all FFTW planning. FFTW's planner has global state and allows one thread at a
/// time; plans may be executed concurrently.
struct FftPlanner {
  std::mutex lock;
  /// FFTW_MEASURE (fft_wisdom.hpp) selects algorithms by timing. The rounding of results, and the
  /// bytes of output files, would then change from run to run.
  unsigned flags = FFTW_ESTIMATE;
};

inline FftPlanner& fft_planner() {
  static FftPlanner planner;
  return planner;
}

}  // namespace stageid
