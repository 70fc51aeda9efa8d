#pragma once

#include <Eigen/Core>
#include <complex>
#include <cstdint>
#include <numbers>
#include <random>
#include <unsupported/Eigen/FFT>
#include <vector>

namespace stageid::test {

/// One period of a random-phase multisine on the odd lines 1, 3, ..., 2 * lines - 1. hal must not use excitation, so
/// its tests have this copy.
inline Eigen::VectorXd odd_multisine(int period, int lines, double rms, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
  const double amplitude = rms * std::sqrt(2.0 / lines);
  std::vector<std::complex<double>> spectrum(period);
  for (int i = 0; i < lines; ++i) {
    const auto line = static_cast<std::size_t>(2 * i + 1);
    spectrum[line] = std::polar(0.5 * amplitude * period, phase(engine));
    spectrum[static_cast<std::size_t>(period) - line] = std::conj(spectrum[line]);
  }
  std::vector<std::complex<double>> samples;
  Eigen::FFT<double> fft;
  fft.inv(samples, spectrum);
  Eigen::VectorXd signal(period);
  for (int n = 0; n < period; ++n) signal[n] = samples[n].real();
  return signal;
}

/// Complex amplitudes: x[n] = Re sum_k X[k] exp(2 pi i k n / N), k > 0.
inline Eigen::VectorXcd spectrum(const Eigen::VectorXd& signal) {
  std::vector<std::complex<double>> samples(signal.begin(), signal.end());
  std::vector<std::complex<double>> lines;
  Eigen::FFT<double> fft;
  fft.fwd(lines, samples);
  Eigen::VectorXcd out(signal.size());
  for (Eigen::Index k = 0; k < out.size(); ++k)
    out[k] = lines[k] * 2.0 / static_cast<double>(signal.size());
  return out;
}

}  // namespace stageid::test
