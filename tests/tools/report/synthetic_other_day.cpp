#include <algorithm>
#include <cmath>

#include "tests/tools/report/synthetic_random.hpp"
#include "tests/tools/report/synthetic_report.hpp"

namespace stageid::test {

Eigen::MatrixXcd with_noise(const Eigen::MatrixXcd& response, const Eigen::MatrixXd& variance,
                            Random& random) {
  Eigen::MatrixXcd out = response;
  for (Eigen::Index k = 0; k < out.cols(); ++k)
    for (Eigen::Index c = 0; c < out.rows(); ++c)
      out(c, k) += std::sqrt(variance(c, k)) * random.circular();
  return out;
}

void add_other_day(ReportData& data, std::uint64_t seed) {
  ReportComparison other;
  other.title = "Tuesday";
  other.model = data.model;
  std::vector<Submodel>& submodels = other.model->submodels;
  submodels.erase(std::ranges::find_if(submodels, &Submodel::is_mode));
  for (Submodel& submodel : submodels)
    if (submodel.is_mode()) {
      submodel.denominator[1] /= 1.0 + kOtherDayShift;
      submodel.denominator[2] /= (1.0 + kOtherDayShift) * (1.0 + kOtherDayShift);
    }
  Random random(seed);
  other.model_response = 0.98 * data.model_response;
  other.response = with_noise(other.model_response, data.frf->total_variance, random);
  data.comparison = other;
}

}  // namespace stageid::test
