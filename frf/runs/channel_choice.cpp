#include "frf/runs/channel_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "frf/response/channel_positions.hpp"

namespace stageid {
namespace {

using Indices = std::vector<Eigen::Index>;

bool contains(const Indices& list, Eigen::Index value) {
  return std::ranges::find(list, value) != list.end();
}

/// The actuators with the names of the excited channels; all actuators if a name does not match.
Indices estimated_actuators(const LogInfo& info, const Indices& excited) {
  Indices found = excited_actuators(info, excited);
  if (found.empty()) return first_indices(std::ssize(info.actuators));
  std::ranges::sort(found);
  return found;
}

void check_counts(const LogInfo& info, const Indices& excited, std::size_t inputs,
                  std::size_t experiments, int realization) {
  const std::string axes = fmt::format("{}", fmt::join(pick(info.excitation, excited).names, ", "));
  if (inputs > experiments)
    fail_request(
        "{} but only {} in realization {} (counted from 1); measure one experiment per "
        "input, or select at most {}",
        counted(inputs, "input"), counted(experiments, "experiment"), realization + 1,
        counted(experiments, "input"));
  if (inputs > excited.size())
    fail_request("{} but only {} ({}); excite one axis per input, or select {}",
                 counted(inputs, "input"), counted(excited.size(), "excited axis", "excited axes"),
                 axes, counted(excited.size(), "input"));
  if (inputs < excited.size())
    fail_request(
        "{} but {} excited axes ({}): the effect of the other axes would be attributed "
        "to the selected inputs; select {} inputs",
        counted(inputs, "input"), excited.size(), axes, excited.size());
  if (experiments < excited.size())
    fail_request(
        "{} but only {} in realization {} (counted from 1); exclude it, or measure one "
        "experiment per axis",
        counted(excited.size(), "excited axis", "excited axes"), counted(experiments, "experiment"),
        realization + 1);
}

}  // namespace

const std::string& ChannelChoice::name(const LogInfo& info, Eigen::Index channel) const {
  const auto c = static_cast<std::size_t>(channel);
  return c < outputs.size() ? info.sensors.name(outputs[c])
                            : info.actuators.name(estimated[c - outputs.size()]);
}

ChannelChoice choose_channels(const LogInfo& info, const std::vector<Eigen::Index>& excited,
                              std::size_t experiments, int realization, const FrfOptions& options) {
  ChannelChoice choice;
  choice.outputs = options.outputs.empty()
                       ? first_indices(std::ssize(info.sensors))
                       : channel_positions(info.sensors, options.outputs, "outputs", "sensor");
  const Indices asked = channel_positions(info.actuators, options.inputs, "inputs", "actuator");
  const Indices by_excitation = estimated_actuators(info, excited);
  const bool part_of_the_excited =
      asked.size() < excited.size() && by_excitation.size() == excited.size() &&
      std::ranges::all_of(asked, [&](Eigen::Index i) { return contains(by_excitation, i); });
  choice.estimated = asked.empty() || part_of_the_excited ? by_excitation : asked;
  choice.inputs = pick(info.actuators, asked.empty() ? by_excitation : asked).names;
  check_counts(info, excited, choice.estimated.size(), experiments, realization);
  for (const Eigen::Index i : first_indices(std::ssize(info.actuators))) {
    if (!contains(choice.estimated, i)) choice.excluded.push_back(i);
  }
  return choice;
}

std::vector<Eigen::Index> first_indices(Eigen::Index count) {
  Indices indices(static_cast<std::size_t>(count));
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

std::vector<Eigen::Index> actuators_of_excitation(const LogInfo& info) {
  std::vector<Eigen::Index> actuators;
  const auto& names = info.actuators.names;
  for (const std::string& name : info.excitation.names) {
    const auto at = std::ranges::find(names, name);
    actuators.push_back(at == names.end() ? -1 : at - names.begin());
  }
  return actuators;
}

std::vector<Eigen::Index> excited_actuators(const LogInfo& info,
                                            const std::vector<Eigen::Index>& axes) {
  const std::vector<Eigen::Index> actuators = actuators_of_excitation(info);
  std::vector<Eigen::Index> found;
  for (const Eigen::Index axis : axes) found.push_back(actuators[axis]);
  if (contains(found, -1)) found.clear();
  return found;
}

}  // namespace stageid
