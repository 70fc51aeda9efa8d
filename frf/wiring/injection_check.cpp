#include "frf/wiring/injection_check.hpp"

#include <algorithm>
#include <cmath>

namespace stageid {
namespace {

using Index = Eigen::Index;

constexpr double kExact = 1e-5;  // of the actuator's rms

/// R of excitation channel `r`, repeated for every period, all lines in one column: the same order as Z.
Eigen::VectorXcd over_periods(const HealthRecord& record, Index r) {
  Index columns = 0;
  for (const int periods : record.periods) columns += periods;
  Eigen::VectorXcd all(columns * static_cast<Index>(record.lines.size()));
  Index at = 0;
  for (const LineRecord& line : record.lines)
    for (Index e = 0; e < record.experiments(); ++e)
      for (int p = 0; p < record.periods[static_cast<std::size_t>(e)]; ++p)
        all[at++] = line.R(r, e);
  return all;
}

Eigen::VectorXcd over_periods_of_actuator(const HealthRecord& record, Index a) {
  Index columns = record.lines.empty() ? 0 : record.lines.front().Z.cols();
  Eigen::VectorXcd all(columns * static_cast<Index>(record.lines.size()));
  for (std::size_t k = 0; k < record.lines.size(); ++k)
    all.segment(columns * static_cast<Index>(k), columns) =
        record.lines[k].Z.row(record.n_y() + a).transpose();
  return all;
}

}  // namespace

std::vector<Index> actuators_of_excitation(const LogInfo& info) {
  std::vector<Index> actuators;
  const auto& names = info.actuators.names;
  for (const std::string& name : info.excitation.names) {
    const auto at = std::find(names.begin(), names.end(), name);
    actuators.push_back(at == names.end() ? -1 : at - names.begin());
  }
  return actuators;
}

std::vector<MappedExcitation> find_mapped_excitation(const HealthRecord& record) {
  std::vector<MappedExcitation> found;
  for (Index a = 0; a < record.n_u(); ++a) {
    const Eigen::VectorXcd U = over_periods_of_actuator(record, a);
    const double power = U.squaredNorm();
    if (!(power > 0.0)) continue;
    for (const Index r : record.axes) {
      const Eigen::VectorXcd R = over_periods(record, r);
      const double factor = R.dot(U).real() / R.squaredNorm();
      if (!((U - factor * R).squaredNorm() <= kExact * kExact * power)) continue;
      found.push_back({a, r, factor});
      break;
    }
  }
  return found;
}

}  // namespace stageid
