#include "excitation/multisine/dft.hpp"

#include <fftw3.h>

#include <algorithm>
#include <complex>
#include <new>
#include <stdexcept>

#include "excitation/multisine/fft_planner.hpp"

namespace stageid {

struct RealDft::Plan {
  explicit Plan(int n)
      : length(n),
        real(fftw_alloc_real(static_cast<std::size_t>(n))),
        half(fftw_alloc_complex(static_cast<std::size_t>(n) / 2 + 1)) {
    const std::lock_guard guard(fft_planner().lock);
    if (real != nullptr && half != nullptr) {
      forward = fftw_plan_dft_r2c_1d(n, real, half, fft_planner().flags);
      inverse = fftw_plan_dft_c2r_1d(n, half, real, fft_planner().flags);
    }
    if (forward == nullptr || inverse == nullptr) {
      release();
      throw std::bad_alloc();
    }
  }
  ~Plan() {
    const std::lock_guard guard(fft_planner().lock);
    release();
  }
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;

  void release() noexcept {
    if (forward != nullptr) fftw_destroy_plan(forward);
    if (inverse != nullptr) fftw_destroy_plan(inverse);
    fftw_free(real);
    fftw_free(half);
  }

  int length;
  double* real;
  fftw_complex* half;
  fftw_plan forward = nullptr;
  fftw_plan inverse = nullptr;
};

RealDft::RealDft(int length) {
  if (length < 2) throw std::invalid_argument("DFT: the length must be at least 2");
  plan_ = std::make_unique<Plan>(length);
}
RealDft::~RealDft() = default;
RealDft::RealDft(RealDft&&) noexcept = default;
RealDft& RealDft::operator=(RealDft&&) noexcept = default;

int RealDft::length() const noexcept { return plan_->length; }

std::span<double> RealDft::input() noexcept {
  return {plan_->real, static_cast<std::size_t>(plan_->length)};
}

std::span<const std::complex<double>> RealDft::forward() {
  fftw_execute(plan_->forward);
  // FFTW documents that fftw_complex and std::complex<double> have the same layout.
  return {reinterpret_cast<const std::complex<double>*>(plan_->half),
          static_cast<std::size_t>(half_size())};
}

std::span<const std::complex<double>> RealDft::forward(
    const Eigen::Ref<const Eigen::VectorXd>& samples) {
  std::copy_n(samples.data(), samples.size(), plan_->real);
  return forward();
}

Eigen::VectorXd RealDft::inverse(const Eigen::Ref<const Eigen::VectorXcd>& half_spectrum) {
  if (half_spectrum.size() != half_size()) {
    throw std::invalid_argument("inverse DFT: the half spectrum must have length / 2 + 1 entries");
  }
  std::copy(half_spectrum.data(), half_spectrum.data() + half_spectrum.size(),
            reinterpret_cast<std::complex<double>*>(plan_->half));
  fftw_execute(plan_->inverse);
  return Eigen::Map<const Eigen::VectorXd>(plan_->real, plan_->length);
}

}  // namespace stageid
