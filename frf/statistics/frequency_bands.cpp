#include "frf/statistics/frequency_bands.hpp"

namespace stageid {

std::vector<Eigen::Index> octave_bands(const Eigen::VectorXd& frequency_hz,
                                       Eigen::Index fewest_lines) {
  std::vector<Eigen::Index> limits = {0};
  double first_hz = frequency_hz[0];
  for (Eigen::Index k = 1; k < frequency_hz.size(); ++k) {
    if (frequency_hz[k] < 2.0 * first_hz || k - limits.back() < fewest_lines) continue;
    limits.push_back(k);
    first_hz = frequency_hz[k];
  }
  if (limits.size() > 1 && frequency_hz.size() - limits.back() < fewest_lines) limits.pop_back();
  limits.push_back(frequency_hz.size());
  return limits;
}

}  // namespace stageid
