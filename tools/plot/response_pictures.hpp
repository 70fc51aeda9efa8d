#pragma once

#include <Eigen/Core>
#include <vector>

#include "tools/plot/picture.hpp"
#include "tools/report/report.hpp"

namespace stageid {

// Figures for a paper, of the numbers that the page shows; a column of two-column print is 3.5 in wide, both are
// 7.16 in.

/// CMIF curves over frequency, with a ring where a mode was chosen and a line where the model has one.
/// Table "cmif.txt": frequency_hz and each curve; "modes.txt": frequency and value of the rings.
/// @throws std::invalid_argument if data.frf is missing.
Picture cmif_picture(const ReportData& data);

/// Magnitudes of the elements `outputs` x `inputs`, one panel each, all on the same axes: measured and, where there
/// is one, modelled. Tables "OUTPUT_INPUT.txt" by index: frequency_hz measured [model].
/// @throws std::invalid_argument if data.frf is missing, or if there are more panels than can be read.
Picture bode_picture(const ReportData& data, const std::vector<Eigen::Index>& outputs,
                     const std::vector<Eigen::Index>& inputs);

/// One element, large: measured, modelled, the residual |G - P| and the standard deviation of G.
/// Table "entry.txt": frequency_hz measured [model residual] [deviation].
/// @throws std::invalid_argument if data.frf is missing.
Picture entry_picture(const ReportData& data, Eigen::Index output, Eigen::Index input);

}  // namespace stageid
