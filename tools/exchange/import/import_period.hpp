#pragma once

#include <Eigen/Core>

#include "tools/exchange/import/import_signals.hpp"

namespace stageid {

/// The rows of a run.
struct RunRows {
  Eigen::Index first = 0;
  Eigen::Index count = 0;
};

/// The rows of a run of whole periods: transient ones and at least one more.
/// @throws FormatError naming the required key of the map
RunRows rows_of(const ArrayList& arrays, const ImportMap& map, const ImportMap::Run& run,
                Eigen::Index samples);

/// One period of the excitation, period_samples x channels: given as such, repeated exactly, or, if it was measured,
/// the mean of the periods after the transient.
/// @throws FormatError if the excitation does not repeat; if it repeats in pieces, the message contains the rows of
/// the runs
Eigen::MatrixXd period_of(const ArrayList& arrays, const ImportMap& map,
                          const SignalGroup& excitation, const RunRows& rows);

}  // namespace stageid
