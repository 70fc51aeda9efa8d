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
        real(fftw_alloc_real(static_cast<std::size_t>(n)), &fftw_free),
        half(fftw_alloc_complex(static_cast<std::size_t>(n) / 2 + 1), &fftw_free) {
    if (!real || !half) throw std::bad_alloc();
    {
      const std::lock_guard guard(fft_planner().lock);
      forward.reset(fftw_plan_dft_r2c_1d(n, real.get(), half.get(), fft_planner().flags));
      inverse.reset(fftw_plan_dft_c2r_1d(n, half.get(), real.get(), fft_planner().flags));
    }
    if (!forward || !inverse) throw std::bad_alloc();
  }

  struct Destroy {
    void operator()(fftw_plan plan) const {
      const std::lock_guard guard(fft_planner().lock);
      fftw_destroy_plan(plan);
    }
  };
  int length;
  std::unique_ptr<double, void (*)(void*)> real;
  std::unique_ptr<fftw_complex, void (*)(void*)> half;
  std::unique_ptr<fftw_plan_s, Destroy> forward;
  std::unique_ptr<fftw_plan_s, Destroy> inverse;
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
  return {plan_->real.get(), static_cast<std::size_t>(plan_->length)};
}

std::span<const std::complex<double>> RealDft::forward() {
  fftw_execute(plan_->forward.get());
  // FFTW documents that fftw_complex and std::complex<double> have the same layout.
  return {reinterpret_cast<const std::complex<double>*>(plan_->half.get()),
          static_cast<std::size_t>(half_size())};
}

std::span<const std::complex<double>> RealDft::forward(
    const Eigen::Ref<const Eigen::VectorXd>& samples) {
  std::copy_n(samples.data(), samples.size(), plan_->real.get());
  return forward();
}

Eigen::VectorXd RealDft::inverse(const Eigen::Ref<const Eigen::VectorXcd>& half_spectrum) {
  if (half_spectrum.size() != half_size()) {
    throw std::invalid_argument("inverse DFT: the half spectrum must have length / 2 + 1 entries");
  }
  std::copy(half_spectrum.data(), half_spectrum.data() + half_spectrum.size(),
            reinterpret_cast<std::complex<double>*>(plan_->half.get()));
  fftw_execute(plan_->inverse.get());
  return Eigen::Map<const Eigen::VectorXd>(plan_->real.get(), plan_->length);
}

}  // namespace stageid
