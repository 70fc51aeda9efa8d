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
/// @throws FormatError with what the map must say instead
RunRows rows_of(const ArrayList& arrays, const ImportMap& map, const ImportMap::Run& run,
                Eigen::Index samples);

/// One period of the excitation, period_samples x channels: given as such, repeated exactly, or, if it was
/// measured, the mean behind the transient.
/// @throws FormatError where the excitation does not repeat; where it repeats piece by piece, the rows of the
/// runs are in the message
Eigen::MatrixXd period_of(const ArrayList& arrays, const ImportMap& map,
                          const SignalGroup& excitation, const RunRows& rows);

}  // namespace stageid
