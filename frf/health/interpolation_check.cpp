#include "frf/health/interpolation_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "frf/plant/zippered_fit.hpp"
#include "frf/statistics/distributions.hpp"

namespace stageid {
namespace {

constexpr double kByChance = 1e-4;
constexpr std::size_t kMostBands = 4;
constexpr double kEverywhere = 0.2;  // of the lines: then the cause is distortion, not resonances

struct Band {
  double low_hz = 0.0;
  double high_hz = 0.0;
  double largest = 0.0;
};

/// Neighbouring lines share data, so lines a few apart belong to one band.
std::vector<Band> doubtful_bands(const FrfEstimate& frf, Eigen::Index axes, Eigen::Index& lines) {
  const int dof = frf.realizations * static_cast<int>(axes) *
                  (zippered_window(static_cast<int>(axes)) - ZipperedFit::kRegressors);
  std::vector<Band> bands;
  Eigen::Index before = -axes - 1;
  for (Eigen::Index k = 0; k < frf.lines(); ++k) {
    const double misfit = frf.interpolation_misfit[k];
    if (!(misfit > 1.0) || log_tail_of_f(misfit, dof, frf.noise_dof) > std::log(kByChance))
      continue;
    if (k - before > axes) bands.push_back({frf.frequency_hz[k], 0.0, 0.0});
    before = k;
    bands.back().high_hz = frf.frequency_hz[k];
    bands.back().largest = std::max(bands.back().largest, misfit);
    ++lines;
  }
  return bands;
}

}  // namespace

std::vector<Finding> check_interpolation(const FrfEstimate& frf) {
  if (frf.interpolation_misfit.size() == 0 || !(frf.noise_dof > 0.0)) return {};
  Eigen::Index lines = 0;
  std::vector<Band> bands = doubtful_bands(frf, frf.n_inputs(), lines);
  if (bands.empty()) return {};
  std::stable_sort(bands.begin(), bands.end(),
                   [](const Band& a, const Band& b) { return a.largest > b.largest; });
  std::string figure;
  for (std::size_t i = 0; i < std::min(bands.size(), kMostBands); ++i)
    figure += fmt::format("{}{:.2g} times the noise at {:.4g} ... {:.4g} Hz", i == 0 ? "" : ", ",
                          bands[i].largest, bands[i].low_hz, bands[i].high_hz);
  if (bands.size() > kMostBands)
    figure += fmt::format(" and in {} more bands", bands.size() - kMostBands);
  Finding finding;
  finding.severity = Severity::doubt;
  finding.cause = Cause::interpolation;
  finding.figure = figure;
  if (static_cast<double>(lines) > kEverywhere * static_cast<double>(frf.lines())) {
    finding.what =
        "the residual between the zippered lines exceeds the noise, because of distortion or too "
        "few lines";
    finding.remedy = "lower the level, lengthen the period, or measure with orthogonal_dft";
  } else {
    finding.what =
        "resonances are too narrow for the zippered lines: the error of the response exceeds its "
        "variance";
    finding.remedy = "lengthen the period, or measure with orthogonal_dft";
  }
  return {finding};
}

}  // namespace stageid
