#include "frf/run_steps.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "excitation/file_error.hpp"

namespace stageid {

std::span<const std::complex<double>> transform(const Eigen::MatrixXd& samples,
                                                Eigen::Index channel, RealDft& dft) {
  std::copy(samples.col(channel).data(), samples.col(channel).data() + samples.rows(),
            dft.input().begin());
  return dft.forward();
}

void line_spectra(const Eigen::MatrixXd& samples, const std::vector<Eigen::Index>& channels,
                  const std::vector<int>& lines, Eigen::Index first_row, RealDft& dft,
                  Eigen::MatrixXcd& spectra) {
  const double scale = 1.0 / static_cast<double>(dft.length());
  Eigen::Index row = first_row;
  for (const Eigen::Index channel : channels) {
    const auto spectrum = transform(samples, channel, dft);
    for (Eigen::Index k = 0; k < spectra.cols(); ++k) {
      spectra(row, k) =
          scale * spectrum[static_cast<std::size_t>(lines[static_cast<std::size_t>(k)])];
    }
    ++row;
  }
}

void add_outer_product(double weight, const Eigen::VectorXd& re, const Eigen::VectorXd& im,
                       double* packed_re, double* packed_im) {
  for (Eigen::Index i = 0; i < re.size(); ++i) {
    const double a = weight * re[i];
    const double b = weight * im[i];
    for (Eigen::Index j = 0; j <= i; ++j) {
      packed_re[j] += a * re[j] + b * im[j];
      packed_im[j] += b * re[j] - a * im[j];
    }
    packed_re += i + 1;
    packed_im += i + 1;
  }
}

Eigen::VectorXd excluded_power(const std::vector<int>& lines, int periods, RunWorkspace& w) {
  const double scale = 1.0 / (static_cast<double>(w.dft.length()) * periods);
  Eigen::VectorXd power = Eigen::VectorXd::Zero(w.excluded_sum.cols());
  for (Eigen::Index c = 0; c < power.size(); ++c) {
    const auto spectrum = transform(w.excluded_sum, c, w.dft);
    for (const int line : lines)
      power[c] += std::norm(scale * spectrum[static_cast<std::size_t>(line)]);
  }
  return power;
}

void refuse_marked_run(const UsedRun& run) {
  throw FormatError(run.log->path(), fmt::format("/runs/{}", run.run().name),
                    fmt::format("each of its {} periods after the transient has a marked sample; "
                                "measure this run again",
                                run.periods));
}

}  // namespace stageid
