#include "estimation/model_structure.hpp"

#include <algorithm>
#include <numbers>

namespace stageid {

Submodel mode_submodel(const FrfEstimate& frf, const ModelStructure& structure,
                       const ModeCandidate& mode) {
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  Submodel s;
  s.denominator = {1.0, 2.0 * mode.damping_ratio / omega, 1.0 / (omega * omega)};
  s.numerator.assign(structure.general_damping ? 2 : 1,
                     Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs()));
  return s;
}

std::vector<Submodel> fixed_submodels(const FrfEstimate& frf, const ModelStructure& structure) {
  std::vector<Submodel> out;
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs());
  if (structure.rigid_body) out.push_back({2, {1.0}, {zero}, {}, {}});
  if (structure.direct_term) out.push_back({0, {1.0}, {zero}, {}, {}});
  return out;
}

int count_modes(const AdditiveModel& model) {
  return static_cast<int>(std::count_if(model.submodels.begin(), model.submodels.end(),
                                        [](const Submodel& s) { return s.is_mode(); }));
}

void sort_modes(AdditiveModel& model) {
  std::stable_sort(model.submodels.begin(), model.submodels.end(),
                   [](const Submodel& a, const Submodel& b) {
                     if (a.is_mode() != b.is_mode()) return b.is_mode();
                     return a.is_mode() && a.natural_frequency_hz() < b.natural_frequency_hz();
                   });
}

Eigen::Index most_modes(const FrfEstimate& frf, const ModelStructure& structure) {
  const Eigen::Index per_mode = structure.general_damping ? 2 : 1;
  const Eigen::Index fixed = (structure.rigid_body ? 1 : 0) + (structure.direct_term ? 1 : 0);
  return std::max<Eigen::Index>(1, (2 * frf.lines() / 3 - fixed) / (per_mode + 1));
}

}  // namespace stageid
