#include "estimation/settled_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimation/fit_additive_model.hpp"
#include "estimation/model_structure.hpp"

namespace stageid {
namespace {

// A mode that is known better than this does not keep a fit from converging.
constexpr double kLeastDoubt = 1.0;

struct OpenMode {
  std::size_t submodel = 0;
  double doubt = 0.0;  ///< larger of std(zeta)/zeta and std(f)/(zeta f)
};

std::optional<OpenMode> most_open(const AdditiveModel& model) {
  std::optional<OpenMode> open;
  for (std::size_t i = 0; i < model.submodels.size(); ++i) {
    const Submodel& s = model.submodels[i];
    if (!is_searched_mode(s)) continue;
    const double damping = s.damping_ratio();
    const double width_hz = damping * s.natural_frequency_hz();
    const double doubt = std::max(s.damping_ratio_std.value_or(0.0) / damping,
                                  s.natural_frequency_std_hz.value_or(0.0) / width_hz);
    if (doubt > (open ? open->doubt : kLeastDoubt)) open = {i, doubt};
  }
  return open;
}

bool may_converge(const FitResult& fit) {
  return fit.status == FitStatus::iteration_limit || fit.status == FitStatus::cost_stalled;
}

}  // namespace

FitResult settled_fit(const FrfEstimate& frf, const AdditiveModel& start,
                      const FitOptions& options) {
  FitResult first = fit_additive_model(frf, start, options);
  if (!may_converge(first)) return first;
  FitResult fit = first;
  std::vector<std::string> left_out;
  while (may_converge(fit) && count_modes(fit.model) > 1) {
    const std::optional<OpenMode> open = most_open(fit.model);
    if (!open) break;
    AdditiveModel fewer = fit.model;
    const auto place = fewer.submodels.begin() + static_cast<std::ptrdiff_t>(open->submodel);
    const double frequency_hz = place->natural_frequency_hz();
    fewer.submodels.erase(place);
    const double cost = fit.model.fit.cost;
    fit = fit_additive_model(frf, fewer, options);
    left_out.push_back(fmt::format(
        "left out {:.6g} Hz, which the data do not determine (standard deviation {:.2g} times "
        "its size) and which kept the fit from converging: cost {:.6g} -> {:.6g}",
        frequency_hz, open->doubt, cost, fit.model.fit.cost));
  }
  if (!fit.trustworthy()) return first;
  fit.decisions.insert(fit.decisions.begin(), left_out.begin(), left_out.end());
  return fit;
}

}  // namespace stageid
