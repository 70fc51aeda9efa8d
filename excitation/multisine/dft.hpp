#pragma once

#include <Eigen/Core>
#include <complex>
#include <memory>
#include <span>

struct fftw_plan_s;

namespace stageid {

/// Plans and runs real DFTs of one length with FFTW. One lock guards planning for the whole program.
/// forward() and inverse() may be called from several threads if each thread has its own object.
class RealDft {
 public:
  /// @throws std::invalid_argument if `length` < 2.
  explicit RealDft(int length);

  int length() const noexcept { return length_; }
  int half_size() const noexcept { return length_ / 2 + 1; }

  /// The object's aligned input buffer, size length(): fill it, then call forward().
  std::span<double> input() noexcept { return {real_.get(), static_cast<std::size_t>(length_)}; }

  /// X(l) = sum_n x(n) exp(-2 pi j l n / N), l = 0 .. N/2; no scaling. Valid until the next call.
  std::span<const std::complex<double>> forward();
  /// The same of `length()` samples, which become the input.
  std::span<const std::complex<double>> forward(const Eigen::Ref<const Eigen::VectorXd>& samples);

  /// x(n) = sum over l of both signs of X(l) exp(2 pi j l n / N), without 1/N. `half_spectrum`
  /// contains l = 0 .. N/2, size half_size().
  Eigen::VectorXd inverse(const Eigen::Ref<const Eigen::VectorXcd>& half_spectrum);

 private:
  struct Destroy {
    void operator()(fftw_plan_s* plan) const;
  };

  int length_;
  std::unique_ptr<double, void (*)(void*)> real_;
  std::unique_ptr<std::complex<double>, void (*)(void*)> half_;
  std::unique_ptr<fftw_plan_s, Destroy> forward_;
  std::unique_ptr<fftw_plan_s, Destroy> inverse_;
};

}  // namespace stageid
