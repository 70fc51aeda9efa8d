#include "excitation/multisine/dft.hpp"

#include <fftw3.h>

#include <algorithm>
#include <mutex>
#include <new>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

/// FFTW's planner has global state and allows one thread at a time; plans may be executed concurrently.
std::mutex& planner_lock() {
  static std::mutex lock;
  return lock;
}

/// FFTW_MEASURE would select algorithms by timing, and the bytes of results would change from run to run.
constexpr unsigned kPlanning = FFTW_ESTIMATE;

}  // namespace

RealDft::RealDft(int length)
    : length_(length), real_(nullptr, &fftw_free), half_(nullptr, &fftw_free) {
  require(length >= 2, "DFT: the length must be at least 2");
  real_.reset(fftw_alloc_real(static_cast<std::size_t>(length)));
  // FFTW documents that fftw_complex and std::complex<double> have the same layout.
  fftw_complex* const half = fftw_alloc_complex(static_cast<std::size_t>(half_size()));
  half_.reset(reinterpret_cast<std::complex<double>*>(half));
  if (!real_ || !half_) throw std::bad_alloc();
  {
    const std::lock_guard guard(planner_lock());
    forward_.reset(fftw_plan_dft_r2c_1d(length, real_.get(), half, kPlanning));
    inverse_.reset(fftw_plan_dft_c2r_1d(length, half, real_.get(), kPlanning));
  }
  if (!forward_ || !inverse_) throw std::bad_alloc();
}

void RealDft::Destroy::operator()(fftw_plan_s* plan) const {
  const std::lock_guard guard(planner_lock());
  fftw_destroy_plan(plan);
}

std::span<const std::complex<double>> RealDft::forward() {
  fftw_execute(forward_.get());
  return {half_.get(), static_cast<std::size_t>(half_size())};
}

std::span<const std::complex<double>> RealDft::forward(
    const Eigen::Ref<const Eigen::VectorXd>& samples) {
  std::copy_n(samples.data(), samples.size(), real_.get());
  return forward();
}

Eigen::VectorXd RealDft::inverse(const Eigen::Ref<const Eigen::VectorXcd>& half_spectrum) {
  require(half_spectrum.size() == half_size(),
          "inverse DFT: the half spectrum must have length / 2 + 1 entries");
  std::copy_n(half_spectrum.data(), half_spectrum.size(), half_.get());
  fftw_execute(inverse_.get());
  return Eigen::Map<const Eigen::VectorXd>(real_.get(), length_);
}

}  // namespace stageid
