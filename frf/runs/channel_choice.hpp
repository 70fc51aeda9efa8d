#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "frf/response/frf_options.hpp"

namespace stageid {

/// Which channels take part, as positions in the log's lists.
struct ChannelChoice {
  std::vector<Eigen::Index> outputs;    ///< sensors asked for, in that order
  std::vector<Eigen::Index> estimated;  ///< actuators of the estimate
  std::vector<Eigen::Index> excluded;   ///< all other actuators
  std::vector<std::string> inputs;      ///< names asked for, all in `estimated`
};

/// Chooses the channels, given which excitation channels are excited.
///
/// Unless asked otherwise the inputs are the actuators that bear the names of the excited channels,
/// or all if the names do not match. Asked for only some of these, the estimate still takes all of
/// them and its columns are selected: the others move too, and leaving them out would bias the
/// result.
/// @throws std::invalid_argument naming an unknown channel, or if the number of inputs is not the
///         number of excited axes, or there are more inputs than experiments.
ChannelChoice choose_channels(const LogInfo& info, const std::vector<Eigen::Index>& excited,
                              std::size_t experiments, int realization, const FrfOptions& options);

}  // namespace stageid
