#include "frf/periods/octave_record.hpp"

#include <array>
#include <limits>

namespace stageid {
namespace {

using Eigen::Index;

constexpr std::array<double, 6> kLowPass = {0.3326705529500825,  0.8068915093110924,
                                            0.4598775021184914,  -0.1350110200102546,
                                            -0.0854412738820267, 0.0352262918857095};

Index floor_divide(Index a, Index b) { return (a >= 0 ? a : a - b + 1) / b; }

/// Every `keep`-th value of `x` filtered by taps that are `spacing` apart.
Eigen::VectorXd filtered(const Eigen::VectorXd& x, const std::array<double, 6>& taps, Index spacing,
                         Index keep) {
  const Index reach = 5 * spacing;
  const Index count = x.size() > reach ? (x.size() - reach + keep - 1) / keep : 0;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(count);
  if (count == 0) return sum;
  for (std::size_t i = 0; i < taps.size(); ++i) {
    const Eigen::Map<const Eigen::VectorXd, 0, Eigen::InnerStride<>> shifted(
        x.data() + static_cast<Index>(i) * spacing, count, Eigen::InnerStride<>(keep));
    sum += taps[i] * shifted;
  }
  return sum;
}

std::array<double, 6> high_pass() {
  std::array<double, 6> taps{};
  for (std::size_t i = 0; i < taps.size(); ++i)
    taps[i] = (i % 2 == 0 ? 1.0 : -1.0) * kLowPass[taps.size() - 1 - i];
  return taps;
}

/// Adds one uninterrupted sequence of periods, starting at column `first`, to the octaves.
void add_stretch(const Eigen::Ref<const Eigen::MatrixXd>& periods, Index first,
                 std::vector<OctaveRecord>& octaves) {
  const Index N = periods.rows();
  Eigen::VectorXd smooth = periods.reshaped();
  Index step = 1;
  Index spacing = 1;  // of the taps, in positions
  for (OctaveRecord& octave : octaves) {
    const Index keep = octave.step / step;
    const Eigen::VectorXd detail = filtered(smooth, high_pass(), spacing, keep);
    smooth = filtered(smooth, kLowPass, spacing, keep);
    if (keep == 1) spacing *= 2;
    step = octave.step;
    for (Index n = 0; n < detail.size(); ++n) {
      const Index middle = n * step - octave.begin;
      octave.detail(middle % N / step, first + middle / N) = detail[n];
    }
  }
}

}  // namespace

Index OctaveRecord::first_period(Index position) const {
  return floor_divide(begin + position * step, detail.rows() * step);
}

Index OctaveRecord::last_period(Index position) const {
  return floor_divide(begin + position * step + length - 1, detail.rows() * step);
}

std::vector<OctaveRecord> octave_records(const Eigen::Ref<const Eigen::MatrixXd>& periods,
                                         std::span<const int> number, double sample_rate_hz,
                                         double lowest_hz) {
  const Index N = periods.rows();
  std::vector<OctaveRecord> octaves;
  Index step = 1;
  Index length = 1;
  double high_hz = 0.5 * sample_rate_hz;
  for (Index scale = 1; high_hz > lowest_hz; scale *= 2, high_hz *= 0.5) {
    length += 5 * scale;
    if (length > N) break;
    if (scale == step && N / step % 2 == 0) step *= 2;
    OctaveRecord& octave = octaves.emplace_back();
    octave.low_hz = 0.5 * high_hz;
    octave.high_hz = high_hz;
    octave.step = step;
    // A coefficient is assigned to the middle of its samples.
    octave.begin = -(length / 2 / step) * step;
    octave.length = length;
    octave.detail.setConstant(N / step, periods.cols(), std::numeric_limits<double>::quiet_NaN());
  }
  for (Index first = 0; first < periods.cols();) {
    Index end = first + 1;
    while (end < periods.cols() && number[end] == number[end - 1] + 1) ++end;
    add_stretch(periods.middleCols(first, end - first), first, octaves);
    first = end;
  }
  return octaves;
}

}  // namespace stageid
