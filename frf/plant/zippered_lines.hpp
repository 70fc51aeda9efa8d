#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

/// Number of lines per axis for the local model (zippered_fit.hpp). It leaves at least six degrees of freedom for all
/// axes together, and two per axis.
int zippered_window(int axes);

/// Whether the log's experiments excite several axes at once, each on its own lines, so that one experiment is a
/// whole realization.
/// @throws the same as LogReader::excitation()
bool is_zippered(const LogReader& log);

/// The axis of each line of a zippered experiment.
struct ZipperedLines {
  std::vector<int> lines;          ///< ascending
  std::vector<Eigen::Index> axis;  ///< of each line, 0 .. axes - 1
  Eigen::Index axes = 0;

  /// Indices of the lines of one axis, ascending.
  std::vector<Eigen::Index> of(Eigen::Index axis) const;
  /// Range of indices in which every axis has a line at or below, and one at or above.
  Eigen::Index first() const;
  Eigen::Index last() const;
};

/// @param names  of the axes, for the message; `place` names the run
/// @throws std::invalid_argument if an axis has fewer than zippered_window() lines.
void require_enough_lines(const ZipperedLines& lines, const std::vector<std::string>& names,
                          const std::string& place);

}  // namespace stageid
