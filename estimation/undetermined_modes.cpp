#include "estimation/undetermined_modes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "estimation/model_structure.hpp"

namespace stageid {
namespace {

bool is_open(const Submodel& s) {
  return s.natural_frequency_std_hz.value_or(0.0) >= kOpenFrequency * s.natural_frequency_hz() ||
         s.damping_ratio_std.value_or(0.0) >= kOpenDamping * s.damping_ratio();
}

}  // namespace

std::vector<std::size_t> undetermined_modes(const FitResult& fit) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < fit.model.submodels.size(); ++i) {
    const Submodel& s = fit.model.submodels[i];
    if (!is_searched_mode(s) || s.frequency_held || s.damping_held) continue;
    const double f = s.natural_frequency_hz();
    if (f < fit.model.fit.band_hz[0] || f > fit.model.fit.band_hz[1]) continue;
    const bool at_bound = std::find(fit.held.begin(), fit.held.end(), i) != fit.held.end();
    if (at_bound || is_open(s)) out.push_back(i);
  }
  return out;
}

void judge_undetermined_modes(FitResult& fit) {
  std::vector<std::string> places;
  for (const std::size_t i : undetermined_modes(fit)) {
    const Submodel& s = fit.model.submodels[i];
    const bool at_bound = std::find(fit.held.begin(), fit.held.end(), i) != fit.held.end();
    places.push_back(fmt::format("{:.6g} Hz (damping ratio {:.3g}{})", s.natural_frequency_hz(),
                                 s.damping_ratio(),
                                 at_bound ? ", at its bound" : ", its deviation as large"));
  }
  if (places.empty()) return;
  fit.findings.push_back(
      fmt::format("the data do not determine the modes at {}: they lower the cost, and are no "
                  "resonances; do not read them as such",
                  fmt::join(places, ", ")));
  fit.decisions.push_back(fit.findings.back());
  if (!fit.trustworthy()) return;
  fit.status = FitStatus::undetermined;
  fit.message = fit.findings.back();
  fit.model.fit.status = to_string(fit.status);
}

}  // namespace stageid
