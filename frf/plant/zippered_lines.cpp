#include "frf/plant/zippered_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "frf/plant/zippered_fit.hpp"
#include "frf/runs/excitation_spectrum.hpp"

namespace stageid {

int zippered_window(int axes) {
  constexpr int kDof = 6;
  constexpr int kLeastDofOfAnAxis = 2;
  return ZipperedFit::kRegressors + std::max(kLeastDofOfAnAxis, (kDof + axes - 1) / axes);
}

bool is_zippered(const LogReader& log) {
  if (log.runs().empty()) return false;
  RealDft dft(log.info().period_samples);
  const Eigen::MatrixXd period = log.excitation(0);
  if (period.rows() != dft.length()) return false;
  return excitation_spectrum(period, dft).is_zippered();
}

std::vector<Eigen::Index> ZipperedLines::of(Eigen::Index wanted) const {
  std::vector<Eigen::Index> positions;
  for (std::size_t k = 0; k < axis.size(); ++k)
    if (axis[k] == wanted) positions.push_back(static_cast<Eigen::Index>(k));
  return positions;
}

Eigen::Index ZipperedLines::first() const {
  Eigen::Index first = 0;
  for (Eigen::Index p = 0; p < axes; ++p) first = std::max(first, of(p).front());
  return first;
}

Eigen::Index ZipperedLines::last() const {
  Eigen::Index last = static_cast<Eigen::Index>(axis.size()) - 1;
  for (Eigen::Index p = 0; p < axes; ++p) last = std::min(last, of(p).back());
  return last;
}

void require_enough_lines(const ZipperedLines& lines, const std::vector<std::string>& names,
                          const std::string& place) {
  const auto needed = static_cast<std::size_t>(zippered_window(static_cast<int>(lines.axes)));
  for (Eigen::Index p = 0; p < lines.axes; ++p) {
    const std::size_t there = lines.of(p).size();
    if (there >= needed) continue;
    throw std::invalid_argument(fmt::format(
        "{}: zippered lines: {} is excited on {} of the {} lines, but {} are required to "
        "interpolate its responses. Lengthen the period, widen the band, or excite all axes on all "
        "lines in {} experiments (orthogonal_dft)",
        place, names[static_cast<std::size_t>(p)], there, lines.lines.size(), needed, lines.axes));
  }
}

}  // namespace stageid
