#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "frf/response/frf_options.hpp"

namespace stageid {

/// The selected channels, as indices into the log's lists.
struct ChannelChoice {
  std::vector<Eigen::Index> outputs;    ///< requested sensors, in the requested order
  std::vector<Eigen::Index> estimated;  ///< actuators of the estimate
  std::vector<Eigen::Index> excluded;   ///< all other actuators
  std::vector<std::string> inputs;      ///< requested names, all in `estimated`

  /// Name of a channel of [outputs; estimated].
  const std::string& name(const LogInfo& info, Eigen::Index channel) const;
};

/// Selects the channels, given the excited excitation channels.
///
/// By default, the inputs are the actuators with the names of the excited channels, or all actuators if the names do
/// not match. If only some of these are requested, the estimate still includes all of them, and its columns are
/// selected afterwards: the others move too, and omitting them would bias the result.
/// @throws std::invalid_argument naming an unknown channel, or if the number of inputs differs from the number of
///         excited axes, or if there are more inputs than experiments.
ChannelChoice choose_channels(const LogInfo& info, const std::vector<Eigen::Index>& excited,
                              std::size_t experiments, int realization, const FrfOptions& options);

/// 0, 1, ..., count - 1.
std::vector<Eigen::Index> first_indices(Eigen::Index count);

/// For every excitation channel the actuator of its name, or -1.
std::vector<Eigen::Index> actuators_of_excitation(const LogInfo& info);

/// The same for these excitation channels alone; empty if a name is missing.
std::vector<Eigen::Index> excited_actuators(const LogInfo& info,
                                            const std::vector<Eigen::Index>& axes);

}  // namespace stageid
