#include "estimation/model/model_structure.hpp"

#include <algorithm>
#include <numbers>
#include <numeric>

#include "estimation/model/basis.hpp"
#include "frf/response/channel_positions.hpp"

namespace stageid {
namespace {

constexpr double kTaken = 0.05;  // of a frequency: a neighbour this close is found in the residual
constexpr double kSuspensionDamping = 0.1;

}  // namespace

Submodel mode_submodel(const FrfEstimate& frf, const ModelStructure& structure,
                       const ModeCandidate& mode) {
  const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
  Submodel s;
  s.denominator = {1.0, 2.0 * mode.damping_ratio / omega, 1.0 / (omega * omega)};
  s.numerator.assign(structure.general_damping ? 2 : 1,
                     Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs()));
  return s;
}

Submodel suspension_mode(const FrfEstimate& frf, double frequency_hz) {
  Submodel s = mode_submodel(frf, {}, {frequency_hz, kSuspensionDamping, 1});
  s.role = SubmodelRole::suspension;
  return s;
}

ModelStructure structure_of(const AdditiveModel& model) {
  ModelStructure out{.rigid_body = false};
  for (const Submodel& s : model.submodels) {
    if (s.role != SubmodelRole::searched)
      out.given.push_back(s);
    else if (s.is_mode())
      out.general_damping = out.general_damping || s.numerator.size() > 1;
    else
      (s.integrators == 2 ? out.rigid_body : out.direct_term) = true;
  }
  return out;
}

std::vector<Submodel> fixed_submodels(const FrfEstimate& frf, const ModelStructure& structure) {
  std::vector<Submodel> out;
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs());
  if (structure.rigid_body) out.push_back({2, {1.0}, {zero}, {}, {}});
  if (structure.direct_term) out.push_back({0, {1.0}, {zero}, {}, {}});
  out.insert(out.end(), structure.given.begin(), structure.given.end());
  return out;
}

std::vector<ModeCandidate> without_given(const std::vector<ModeCandidate>& candidates,
                                         const ModelStructure& structure) {
  std::vector<ModeCandidate> out = candidates;
  for (const Submodel& s : structure.given)
    for (const std::complex<double> pole : roots(s.coefficients()))
      std::erase_if(out, [&](const ModeCandidate& mode) {
        const double omega = 2.0 * std::numbers::pi * mode.frequency_hz;
        return pole.imag() != 0.0 && std::abs(std::abs(pole) - omega) < kTaken * omega;
      });
  return out;
}

int side_of_lines(const FrfEstimate& frf, double frequency_hz) {
  if (frequency_hz < frf.frequency_hz[0]) return -1;
  return frequency_hz > frf.frequency_hz[frf.lines() - 1] ? 1 : 0;
}

bool is_searched_mode(const Submodel& submodel) noexcept {
  return submodel.role == SubmodelRole::searched && submodel.is_mode();
}

int count_modes(const AdditiveModel& model) {
  return static_cast<int>(std::ranges::count_if(model.submodels, is_searched_mode));
}

std::vector<std::size_t> mode_order(const AdditiveModel& model) {
  std::vector<std::size_t> order(model.submodels.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t i, std::size_t j) {
    const Submodel& a = model.submodels[i];
    const Submodel& b = model.submodels[j];
    const bool mode = is_searched_mode(a);
    if (mode != is_searched_mode(b)) return !mode;
    return mode && a.natural_frequency_hz() < b.natural_frequency_hz();
  });
  return order;
}

Eigen::Index most_modes(const FrfEstimate& frf, const ModelStructure& structure) {
  const Eigen::Index per_mode = structure.general_damping ? 2 : 1;
  Eigen::Index fixed = (structure.rigid_body ? 1 : 0) + (structure.direct_term ? 1 : 0);
  for (const Submodel& s : structure.given)
    fixed += static_cast<Eigen::Index>(s.numerator.size() + s.denominator.size()) - 1;
  return std::max<Eigen::Index>(1, (2 * frf.lines() / 3 - fixed) / (per_mode + 1));
}

}  // namespace stageid
