#include "frf/wiring/nominal_stage.hpp"

#include <algorithm>

namespace stageid {

std::vector<Eigen::Index> positions_in(const std::vector<std::string>& nominal,
                                       const std::vector<std::string>& names,
                                       std::string* missing) {
  std::vector<Eigen::Index> found;
  for (const std::string& name : names) {
    const auto at = std::ranges::find(nominal, name);
    if (at == nominal.end()) {
      if (missing != nullptr) *missing = name;
      return {};
    }
    found.push_back(at - nominal.begin());
  }
  return found;
}

}  // namespace stageid
