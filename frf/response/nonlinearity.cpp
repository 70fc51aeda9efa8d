#include "frf/response/nonlinearity.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "frf/response/channel_tiles.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/statistics/distributions.hpp"
#include "frf/statistics/frequency_bands.hpp"

namespace stageid {
namespace {

constexpr double kCertain = 1e3;  // -ln p of scatter if there is no noise at all

/// -ln p of one line. Without noise, any scatter above the rounding of the `linear` power is certain.
double evidence(double power, double noise, double linear, int power_dof, double noise_dof) {
  if (power <= kPowerRounding * linear) return 0.0;
  if (noise > 0.0) return -log_tail_of_f(power / noise, power_dof, noise_dof);
  return kCertain;
}

/// Scatter of the realizations: column b of p_value and distortion.
/// @param known of the realizations; if it is empty, the variances
void test_scatter(const FrfEstimate& frf, const RealizationScatter& known, const IndexRange& band,
                  Eigen::Index b, NonlinearityTest& test) {
  const int a = static_cast<int>(frf.total_dof);
  const bool is_known = known.total.size() > 0;
  const Eigen::MatrixXd& total = is_known ? known.total : frf.total_variance;
  const Eigen::MatrixXd& noise = is_known ? known.noise : frf.noise_variance;
  const double noise_dof = is_known ? known.noise_dof : frf.noise_dof;
  const auto [first, count] = frf.own();
  for (Eigen::Index c = first; c < first + count; ++c) {
    double sum = 0.0;
    double excess = 0.0;
    for (Eigen::Index k = band.first; k < band.end; ++k) {
      sum += evidence(total(c, k), noise(c, k), std::norm(frf.response(c, k)), a, noise_dof);
      excess += std::max(0.0, frf.total_variance(c, k) - frf.noise_variance(c, k));
    }
    test.p_value(c, b) = tail_of_evidence(sum, band.count());
    const double linear = frf.response.row(c).segment(band.first, band.count()).squaredNorm();
    // A constant output has no response and hence no distortion.
    test.distortion(c, b) = linear > 0.0 ? std::sqrt((a + 1) * excess / linear) : 0.0;
  }
}

/// Detection lines of one parity in [low_hz, high_hz).
std::vector<Eigen::Index> lines_of(const DetectionLines& detection, int parity, double low_hz,
                                   double high_hz) {
  std::vector<Eigen::Index> lines;
  for (Eigen::Index d = 0; d < detection.line.size(); ++d) {
    const double f = detection.frequency_hz[d];
    if (detection.line[d] % 2 == parity && f >= low_hz && f < high_hz) lines.push_back(d);
  }
  return lines;
}

void test_detection(const DetectionLines& detection, const std::vector<Eigen::Index>& lines,
                    const Eigen::VectorXd& linear_power, Eigen::Index b,
                    DetectedDistortion& found) {
  const Eigen::Index n_y = detection.noise.rows();
  const auto K = std::ssize(lines);
  for (Eigen::Index c = 0; c < detection.power.rows(); ++c) {
    double sum = 0.0;
    double excess = 0.0;
    for (const Eigen::Index d : lines) {
      const double power = detection.power(c, d);
      const double noise = detection.noise(c % n_y, d);
      sum += evidence(power, noise, linear_power[c], static_cast<int>(detection.runs[c / n_y]),
                      detection.noise_dof);
      excess += std::max(0.0, power - noise);
    }
    found.p_value(c, b) = tail_of_evidence(sum, K);
    found.level(c, b) = K == 0 || !(linear_power[c] > 0.0)
                            ? 0.0
                            : std::sqrt(excess / static_cast<double>(K) / linear_power[c]);
  }
}

/// The smallest upper tail of any output on the lines [low_hz, high_hz].
double least_tail(const LineAlignment& alignment, double low_hz, double high_hz) {
  double least = 1.0;
  for (Eigen::Index i = 0; i < alignment.cosine.rows(); ++i) {
    double cosine = 0.0;
    double pairs = 0.0;
    for (Eigen::Index l = 0; l < alignment.frequency_hz.size(); ++l) {
      if (alignment.frequency_hz[l] < low_hz || alignment.frequency_hz[l] > high_hz) continue;
      cosine += alignment.cosine(i, l);
      pairs += alignment.pairs(i, l);
    }
    if (pairs >= kFewestLinesOfBand)
      least = std::min(least, tail_of_normal(cosine / std::sqrt(0.5 * pairs)));
  }
  return least;
}

/// Sets settled_p_value, and p-values of 1 in unsettled bands. @pre band_hz and the p-values are set
void test_settling(const LineAlignment& alignment, NonlinearityTest& test) {
  if (alignment.frequency_hz.size() == 0) return;
  const Eigen::Index bands = test.band_hz.rows();
  const double tests = 2.0 * static_cast<double>(alignment.cosine.rows());
  const double everywhere = least_tail(alignment, test.band_hz(0, 0), test.band_hz(bands - 1, 1));
  test.settled_p_value.resize(bands);
  for (Eigen::Index b = 0; b < bands; ++b) {
    const double band = least_tail(alignment, test.band_hz(b, 0), test.band_hz(b, 1));
    test.settled_p_value[b] = std::min(1.0, tests * std::min(band, everywhere));
    if (test.settled(b)) continue;
    test.p_value.col(b).setOnes();
    for (DetectedDistortion* kind : {&test.even, &test.odd})
      if (kind->p_value.size() > 0) kind->p_value.col(b).setOnes();
  }
}

}  // namespace

void LineAlignment::add(const Eigen::MatrixXcd& values, const Eigen::VectorXd& smallest) {
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    Eigen::Index before = -1;
    for (Eigen::Index l = 0; l < values.cols(); ++l) {
      if (!(std::norm(values(i, l)) > smallest[i])) continue;
      if (before >= 0) {
        const std::complex<double> turn = values(i, l) * std::conj(values(i, before));
        cosine(i, l) += turn.real() / std::abs(turn);
        pairs(i, l) += 1.0;
      }
      before = l;
    }
  }
}

bool NonlinearityTest::settled(Eigen::Index b) const {
  return settled_p_value.size() == 0 || settled_p_value[b] >= kUnsettledBelow;
}

double NonlinearityTest::least_p_value() const {
  double least = 1.0;
  for (const Eigen::MatrixXd* p : {&p_value, &even.p_value, &odd.p_value})
    if (p->size() > 0) least = std::min(least, p->minCoeff());
  return least;
}

bool NonlinearityTest::nonlinear() const {
  const auto tests = p_value.size() + even.p_value.size() + odd.p_value.size();
  return tests > 0 && least_p_value() * static_cast<double>(tests) < kNonlinearBelow;
}

std::string why_linearity_cannot_be_tested(const FrfEstimate& frf) {
  if (frf.method != FrfMethod::periodic)
    return "nonlinearity test: neighbouring lines of method 'lpm' share bins; estimate with "
           "'periodic'";
  if (frf.correlated_lines != 1.0)
    return "nonlinearity test: neighbouring lines of a zippered experiment share their data; "
           "measure with 'orthogonal_dft' or 'single_axis'";
  if (frf.covariance_lines > 1)
    return "nonlinearity test: neighbouring lines share their smoothed noise variance; estimate "
           "without smoothing";
  if (frf.noise_variance.size() == 0 || !(frf.noise_dof > 0.0))
    return "nonlinearity test: the noise variance or its noise_dof is unknown; measure two periods";
  if (frf.total_variance.size() == 0 || !(frf.total_dof >= 1.0) ||
      frf.total_dof != std::floor(frf.total_dof))
    return "nonlinearity test: the total variance or its total_dof (realizations - 1) is unknown; "
           "measure two realizations";
  return "";
}

NonlinearityTest nonlinearity_test(const FrfEstimate& frf, const LinearityEvidence& evidence) {
  if (const std::string why = why_linearity_cannot_be_tested(frf); !why.empty())
    throw std::invalid_argument(why);
  const std::vector<IndexRange> octaves = octave_bands(frf.frequency_hz);
  const auto bands = std::ssize(octaves);
  const Eigen::Index n_c = frf.response.rows();
  NonlinearityTest test;
  test.band_hz.resize(bands, 2);
  test.p_value.resize(n_c, bands);
  test.distortion.resize(n_c, bands);
  const DetectionLines& detection = frf.detection;
  if (detection.line.size() > 0) {
    test.even.p_value.resize(detection.power.rows(), bands);
    test.even.level = test.even.p_value;
    test.odd = test.even;
  }
  for (Eigen::Index b = 0; b < bands; ++b) {
    const IndexRange& band = octaves[b];
    const double low_hz = frf.frequency_hz[band.first];
    test.band_hz.row(b) << low_hz, frf.frequency_hz[band.end - 1];
    test_scatter(frf, evidence.scatter, band, b, test);
    if (detection.line.size() == 0) continue;
    const Eigen::VectorXd linear_power =
        detection.linear_power.middleCols(band.first, band.count()).rowwise().mean();
    const double high_hz = frf.frequency_hz[std::min(band.end, frf.lines() - 1)];
    test_detection(detection, lines_of(detection, 0, low_hz, high_hz), linear_power, b, test.even);
    test_detection(detection, lines_of(detection, 1, low_hz, high_hz), linear_power, b, test.odd);
  }
  for (Eigen::MatrixXd* const of_channels : {&test.p_value, &test.distortion})
    frf.team->gather_rows(kTileChannels, *of_channels);
  // The noise of detection lines is pooled over the experiments, whereas their power is that of some.
  if (frf.experiment_noise_ratio > 1.0)
    for (DetectedDistortion* kind : {&test.even, &test.odd}) kind->p_value.setOnes();
  test_settling(evidence.alignment, test);
  return test;
}

NonlinearityTest linearity_of(const FrfEstimate& frf) {
  if (frf.nonlinearity.band_hz.rows() > 0 || !why_linearity_cannot_be_tested(frf).empty())
    return frf.nonlinearity;
  return nonlinearity_test(frf);
}

}  // namespace stageid
