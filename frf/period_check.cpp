#include "frf/period_check.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "frf/frequency_bands.hpp"
#include "frf/tail_probability.hpp"

namespace stageid {
namespace {

constexpr Eigen::Index kFewestLines = 8;
constexpr double kWorthDropping = 4.0;
constexpr double kRounding = 1e-26;      // of the largest line's power: scatter without any noise
constexpr double kSmallestRest = 1e-16;  // of 1 - r, which rounding may make 0
constexpr double kFlushBelow = 1e-250;

using Periods = std::vector<std::size_t>;

/// Sums over the lines of one band, for one channel and each period.
struct BandShares {
  Eigen::VectorXd share;     ///< sum of r
  Eigen::VectorXd log_rest;  ///< sum of ln(1 - r)
  Eigen::Index lines = 0;    ///< with any scatter
};

/// A sum of logarithms as the logarithm of a product, for speed.
class LogSum {
 public:
  void add(double factor) {
    product_ *= factor;
    if (product_ < kFlushBelow) flush();
  }
  double value() {
    flush();
    return sum_;
  }

 private:
  void flush() {
    sum_ += std::log(product_);
    product_ = 1.0;
  }
  double sum_ = 0.0;
  double product_ = 1.0;
};

class Shares {
 public:
  Shares(std::span<const Eigen::MatrixXcd> spectra, const Periods& kept,
         const Eigen::VectorXd& frequency_hz)
      : spectra_(spectra), kept_(kept), leak_(frequency_hz.cwiseInverse()) {
    smallest_.resize(spectra.front().rows());
    for (Eigen::Index c = 0; c < smallest_.size(); ++c)
      smallest_[c] = kRounding * spectra.front().row(c).head(leak_.size()).cwiseAbs2().maxCoeff();
  }

  BandShares of(Eigen::Index channel, Eigen::Index first, Eigen::Index last) {
    const std::size_t P = kept_.size();
    deviate(channel, first, last);
    take_out_leakage(first);
    BandShares band;
    band.share.setZero(static_cast<Eigen::Index>(P));
    std::vector<LogSum> rest(P);
    for (Eigen::Index k = 0; k < deviation_.rows(); ++k) {
      const double scatter = deviation_.row(k).squaredNorm();
      if (!(scatter > smallest_[channel])) continue;
      ++band.lines;
      const double scale = static_cast<double>(P) / (static_cast<double>(P - 1) * scatter);
      for (std::size_t i = 0; i < P; ++i) {
        const double r = scale * std::norm(deviation_(k, static_cast<Eigen::Index>(i)));
        band.share[static_cast<Eigen::Index>(i)] += r;
        rest[i].add(std::max(kSmallestRest, 1.0 - r));
      }
    }
    band.log_rest.resize(band.share.size());
    for (std::size_t i = 0; i < P; ++i)
      band.log_rest[static_cast<Eigen::Index>(i)] = rest[i].value();
    return band;
  }

 private:
  /// Every period's deviation from the mean, lines x periods.
  void deviate(Eigen::Index channel, Eigen::Index first, Eigen::Index last) {
    deviation_.resize(last - first, static_cast<Eigen::Index>(kept_.size()));
    for (std::size_t i = 0; i < kept_.size(); ++i)
      deviation_.col(static_cast<Eigen::Index>(i)) =
          spectra_[kept_[i]].row(channel).segment(first, last - first).transpose();
    const Eigen::VectorXcd mean = deviation_.rowwise().mean();
    deviation_.colwise() -= mean;
  }

  /// Least squares, each line weighed by its own scatter.
  void take_out_leakage(Eigen::Index first) {
    const auto leak = leak_.segment(first, deviation_.rows());
    const Eigen::VectorXd weight =
        deviation_.rowwise().squaredNorm().cwiseMax(1e-300).cwiseInverse();
    const Eigen::VectorXd weighed = weight.cwiseProduct(leak);
    const double size = weighed.dot(leak);
    if (!(size > 0.0) || !std::isfinite(size)) return;
    const Eigen::RowVectorXcd part = weighed.transpose() * deviation_ / size;
    deviation_.noalias() -= leak.cast<std::complex<double>>() * part;
  }

  std::span<const Eigen::MatrixXcd> spectra_;
  const Periods& kept_;
  Eigen::VectorXd leak_;  // shape of leakage over the lines
  Eigen::VectorXd smallest_;
  Eigen::MatrixXcd deviation_;
};

/// The period that stands out most of those kept, as a position in `kept`; none if all belong
/// together.
std::optional<PeriodOutlier> worst(std::span<const Eigen::MatrixXcd> spectra, const Periods& kept,
                                   const std::vector<Eigen::Index>& bands,
                                   const Eigen::VectorXd& frequency_hz) {
  Shares shares(spectra, kept, frequency_hz);
  const auto P = static_cast<double>(kept.size());
  const Eigen::Index channels = spectra.front().rows();
  const double tests = P * static_cast<double>(channels) * static_cast<double>(bands.size() - 1);
  std::optional<PeriodOutlier> found;
  for (std::size_t b = 0; b + 1 < bands.size(); ++b) {
    for (Eigen::Index c = 0; c < channels; ++c) {
      const BandShares band = shares.of(c, bands[b], bands[b + 1]);
      const auto L = static_cast<double>(band.lines);
      Eigen::Index most = 0;
      const double share = band.share.maxCoeff(&most);
      const double ratio = (P - 2.0) * share / std::max(kSmallestRest * L, L - share);
      if (band.lines == 0 || !(ratio > kWorthDropping) || (found && found->ratio >= ratio))
        continue;
      const double chance = tail_of_evidence(-(P - 2.0) * band.log_rest[most], band.lines);
      if (!(chance * tests < kDropByChance)) continue;
      found = PeriodOutlier{static_cast<std::size_t>(most), c, bands[b], bands[b + 1] - 1, ratio};
    }
  }
  return found;
}

}  // namespace

std::vector<PeriodOutlier> find_outliers(std::span<const Eigen::MatrixXcd> periods,
                                         const Eigen::VectorXd& frequency_hz) {
  std::vector<PeriodOutlier> outliers;
  Periods kept(periods.size());
  for (std::size_t p = 0; p < kept.size(); ++p) kept[p] = p;
  const std::vector<Eigen::Index> bands = octave_bands(frequency_hz, kFewestLines);
  while (kept.size() >= 3 && 2 * (outliers.size() + 1) < periods.size()) {
    std::optional<PeriodOutlier> outlier = worst(periods, kept, bands, frequency_hz);
    if (!outlier) break;
    const auto at = kept.begin() + static_cast<std::ptrdiff_t>(outlier->period);
    outlier->period = *at;
    kept.erase(at);
    outliers.push_back(*outlier);
  }
  return outliers;
}

}  // namespace stageid
