#include "frf/response/rigid_lines.hpp"

#include <algorithm>
#include <vector>

#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

constexpr double kBelowGrowth = 0.7;

}  // namespace

Eigen::Index rigid_lines(const Eigen::VectorXd& frequency, const Eigen::VectorXd& gain) {
  std::vector<double> sizes;
  for (Eigen::Index k = 0; k < frequency.size(); ++k) {
    sizes.push_back(frequency[k] * frequency[k] * gain[k]);
    std::vector<double> sorted = sizes;
    if (k + 1 >= kFewestRigidLines && sizes.back() > kRigidGrowth * order_statistic(sorted, 0.5))
      return std::lower_bound(frequency.begin(), frequency.end(), kBelowGrowth * frequency[k]) -
             frequency.begin();
  }
  return frequency.size();
}

}  // namespace stageid
