#include "excitation/multisine/line_spectrum.hpp"

#include <complex>
#include <limits>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

int dense_length(const FrequencyGrid& grid, int oversampling) {
  require(grid.samples_per_period() <= std::numeric_limits<int>::max() / oversampling,
          "multisine: the period is too long for oversampling; shorten it");
  return oversampling * grid.samples_per_period();
}

}  // namespace

LineSpectrum::LineSpectrum(const FrequencyGrid& grid, int oversampling)
    : lines_(grid.lines()),
      dft_(dense_length(grid, oversampling)),
      half_spectrum_(Eigen::VectorXcd::Zero(dft_.half_size())) {}

Eigen::VectorXd LineSpectrum::samples(const Eigen::Ref<const Eigen::VectorXcd>& coefficients) {
  for (std::size_t k = 0; k < lines_.size(); ++k) {
    half_spectrum_[lines_[k]] = coefficients[k];
  }
  return dft_.inverse(half_spectrum_);
}

Eigen::VectorXcd LineSpectrum::coefficients(const Eigen::Ref<const Eigen::VectorXd>& samples) {
  const std::span<const std::complex<double>> spectrum = dft_.forward(samples);
  Eigen::VectorXcd coefficients(std::ssize(lines_));
  for (std::size_t k = 0; k < lines_.size(); ++k) {
    coefficients[k] = spectrum[lines_[k]] / static_cast<double>(dft_.length());
  }
  return coefficients;
}

}  // namespace stageid
