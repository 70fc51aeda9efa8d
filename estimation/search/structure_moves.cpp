#include "estimation/search/structure_moves.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "estimation/fit/overlapping_modes.hpp"
#include "estimation/fit/search_constants.hpp"

namespace stageid {
namespace {

bool is_rigid_body(const Submodel& s) {
  return s.role == SubmodelRole::searched && s.integrators == 2 && s.denominator.size() == 1;
}

/// A body on springs, or a given one.
bool is_settled_body(const Submodel& s) {
  return s.role == SubmodelRole::suspension || (s.integrators > 0 && !is_rigid_body(s));
}

bool is_direct_term(const Submodel& s) {
  return s.role == SubmodelRole::searched && s.integrators == 0 && s.denominator.size() == 1;
}

bool is_biproper(const Submodel& s) {
  return s.numerator.size() >= s.denominator.size() + static_cast<std::size_t>(s.integrators);
}

bool is_general(const Submodel& s) { return is_searched_mode(s) && s.numerator.size() > 1; }

template <typename Predicate>
bool has(const AdditiveModel& model, Predicate is_one) {
  return std::any_of(model.submodels.begin(), model.submodels.end(), is_one);
}

void make_proportional(AdditiveModel& model) {
  for (Submodel& s : model.submodels)
    if (is_general(s)) s.numerator.resize(1);
}

/// Delays are searched from nothing.
void free_delays(DelayModel delay, StructureMove& move) {
  move.options.delay = delay;
  move.options.delay_s = 0.0;
  move.model.input_delay_s.resize(0);
  move.model.output_delay_s.resize(0);
}

}  // namespace

std::vector<StructureMove> richer_structures(const FrfEstimate& frf, const FitOptions& options,
                                             const AdditiveModel& model,
                                             const OpenStructure& open) {
  std::vector<StructureMove> out;
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(frf.n_outputs(), frf.n_inputs());
  const bool affordable = Eigen::Index{2} * count_modes(model) <= most_modes(frf, {});
  if (open.general_damping && affordable &&
      has(model, [](const Submodel& s) { return is_searched_mode(s) && !is_general(s); })) {
    StructureMove general{"--damping general", model, options};
    for (Submodel& s : general.model.submodels)
      if (is_searched_mode(s) && !is_general(s)) s.numerator.push_back(zero);
    out.push_back(std::move(general));
  }
  if (open.direct_term && !has(model, is_biproper)) {
    StructureMove direct{"--direct-term full", model, options};
    direct.model.submodels.push_back({0, {1.0}, {zero}, {}, {}});
    out.push_back(direct);
    // Instead of the modes above the lines, which stand in for it.
    const double highest_hz = frf.frequency_hz[frf.lines() - 1];
    if (std::erase_if(direct.model.submodels, [&](const Submodel& s) {
          return is_searched_mode(s) && s.natural_frequency_hz() > highest_hz;
        }) > 0)
      out.push_back(std::move(direct));
  }
  if (open.rigid_body && !has(model, is_settled_body)) {
    const auto below = [&](const Submodel& s) {
      return is_searched_mode(s) && s.natural_frequency_hz() < frf.frequency_hz[0];
    };
    const auto add_springs = [&](double start, bool instead_of_modes) {
      out.push_back({"--rigid-body suspension", model, options});
      StructureMove& springs = out.back();
      std::erase_if(springs.model.submodels, [&](const Submodel& s) {
        return is_rigid_body(s) || (instead_of_modes && below(s));
      });
      springs.model.submodels.push_back(suspension_mode(frf, start * frf.frequency_hz[0]));
    };
    if (has(model, is_rigid_body)) {
      add_springs(kSuspensionStart, false);
      add_springs(kWeakSpringsStart, false);
    } else {
      out.push_back({"--rigid-body full", model, options});
      out.back().model.submodels.push_back({2, {1.0}, {zero}, {}, {}});
    }
    if (has(model, below)) add_springs(kSuspensionStart, true);
  }
  if (open.delay && options.delay == DelayModel::fixed) {
    out.push_back({"--delay estimate", model, options});
    free_delays(DelayModel::estimate, out.back());
  }
  if (open.delay && options.delay != DelayModel::per_channel && model.hold != HoldModel::none &&
      frf.response.rows() > 1) {
    StructureMove skewed{"--delay per_channel", model, options};
    if (options.delay == DelayModel::fixed)
      free_delays(DelayModel::per_channel, skewed);
    else
      skewed.options.delay = DelayModel::per_channel;
    out.push_back(skewed);
    // A general damping that only imitates the delays is not needed beside them.
    if (open.general_damping && has(model, is_general)) {
      skewed.flag += " --damping proportional";
      make_proportional(skewed.model);
      out.push_back(std::move(skewed));
    }
  }
  return out;
}

StructureMove proportional_damping(const FitOptions& options, const AdditiveModel& model) {
  StructureMove move{"--damping proportional", model, options};
  make_proportional(move.model);
  return move;
}

std::vector<StructureMove> simpler_structures(const FitOptions& options, const AdditiveModel& model,
                                              const OpenStructure& open) {
  std::vector<StructureMove> out;
  if (open.general_damping && has(model, is_general))
    out.push_back(proportional_damping(options, model));
  if (open.delay && options.delay == DelayModel::per_channel) {
    out.push_back({"--delay estimate", model, options});
    out.back().options.delay = DelayModel::estimate;
    out.back().model.input_delay_s.setConstant(model.mean_delay_s());
    out.back().model.output_delay_s.setZero();
  }
  if (!has(model, is_searched_mode)) return out;
  if (open.direct_term && has(model, is_direct_term)) {
    out.push_back({"--direct-term none", model, options});
    std::erase_if(out.back().model.submodels, is_direct_term);
  }
  const auto is_whole_body = [](const Submodel& s) {
    return is_rigid_body(s) || s.role == SubmodelRole::suspension;
  };
  if (open.rigid_body && has(model, is_whole_body)) {
    out.push_back({"--rigid-body none", model, options});
    std::erase_if(out.back().model.submodels, is_whole_body);
  }
  return out;
}

std::vector<StructureMove> structure_moves(const FrfEstimate& frf, const FitOptions& options,
                                           const AdditiveModel& model, const OpenStructure& open) {
  std::vector<StructureMove> out = richer_structures(frf, options, model, open);
  for (StructureMove& move : simpler_structures(options, model, open))
    out.push_back(std::move(move));
  return out;
}

std::vector<StructureMove> merges(const FitOptions& options, const AdditiveModel& model) {
  std::vector<StructureMove> out;
  std::vector<std::size_t> merged;
  for (const auto& [i, j] : overlapping_modes(model)) {
    const double one = model.submodels[i].damping_ratio();
    const double other = model.submodels[j].damping_ratio();
    const std::size_t broader = one > other ? i : j;
    if (std::find(merged.begin(), merged.end(), broader) != merged.end()) continue;
    merged.push_back(broader);
    out.push_back(
        {fmt::format("merged {:.6g} and {:.6g} Hz", model.submodels[i].natural_frequency_hz(),
                     model.submodels[j].natural_frequency_hz()),
         with_one_of(model, i, j), options});
  }
  return out;
}

}  // namespace stageid
