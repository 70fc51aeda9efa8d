#include "estimation/fit/overlapping_modes.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/model/model_structure.hpp"

namespace stageid {

std::vector<std::pair<std::size_t, std::size_t>> overlapping_modes(const AdditiveModel& model) {
  struct Pair {
    std::size_t i, j;
    double distance;  // in half-power widths
  };
  std::vector<Pair> pairs;
  const std::vector<Submodel>& all = model.submodels;
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t j = i + 1; j < all.size(); ++j) {
      if (!is_searched_mode(all[i]) || !is_searched_mode(all[j])) continue;
      const double f = all[i].natural_frequency_hz();
      const double width = 2.0 * f * std::max(all[i].damping_ratio(), all[j].damping_ratio());
      const double distance = std::abs(all[j].natural_frequency_hz() - f) / width;
      if (distance < 1.0) pairs.push_back({i, j, distance});
    }
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (const Pair& pair : pairs) out.emplace_back(pair.i, pair.j);
  return out;
}

AdditiveModel with_one_of(const AdditiveModel& model, std::size_t i, std::size_t j) {
  AdditiveModel out = model;
  const Submodel& one = model.submodels[i];
  const Submodel& other = model.submodels[j];
  // Of a broad and a narrow mode, the narrow one determines the pole.
  const double share = 1.0 / (1.0 + std::pow(one.damping_ratio() / other.damping_ratio(), 2));
  const double a2 = std::pow(one.denominator[2], share) * std::pow(other.denominator[2], 1 - share);
  const double damping =
      std::pow(one.damping_ratio(), share) * std::pow(other.damping_ratio(), 1 - share);
  out.submodels[i].denominator = {1.0, 2.0 * damping * std::sqrt(a2), a2};
  out.submodels.erase(out.submodels.begin() + static_cast<std::ptrdiff_t>(j));
  return out;
}

}  // namespace stageid
