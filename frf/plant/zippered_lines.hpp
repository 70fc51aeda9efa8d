#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "acquisition/record/log_reader.hpp"

namespace stageid {

/// Lines of each axis from which its responses are told between them (zippered_fit.hpp): as many as
/// leave the local model of all axes together six degrees of freedom, and two an axis.
int zippered_window(int axes);

/// Whether the log's experiments excite several axes at once, each on lines of its own, so that one
/// experiment is a whole realization.
/// @throws what LogReader::excitation() throws
bool is_zippered(const LogReader& log);

/// Which axis has each line of a zippered experiment.
struct ZipperedLines {
  std::vector<int> lines;          ///< ascending
  std::vector<Eigen::Index> axis;  ///< of each line, 0 .. axes - 1
  Eigen::Index axes = 0;

  /// Positions of the lines of one axis, ascending.
  std::vector<Eigen::Index> of(Eigen::Index axis) const;
  /// Positions from which to which every axis has a line below (or there) and one above.
  Eigen::Index first() const;
  Eigen::Index last() const;
};

/// @param names  of the axes, for the message; `place` names the run
/// @throws std::invalid_argument if an axis has fewer than zippered_window() lines.
void require_enough_lines(const ZipperedLines& lines, const std::vector<std::string>& names,
                          const std::string& place);

}  // namespace stageid
