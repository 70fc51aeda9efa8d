#pragma once

#include <Eigen/Core>
#include <vector>

#include "tools/plot/picture.hpp"
#include "tools/report/report_page.hpp"

namespace stageid {

// Figures for a paper, from the numbers of the page.

/// In two-column print: one column, and both.
inline constexpr double kColumn_in = 3.5;
inline constexpr double kPage_in = 7.16;

/// CMIF curves over frequency, with a ring per chosen mode and a line per mode of the model.
/// Table "cmif.txt": frequency_hz and each curve; "modes.txt": frequency and value of the rings.
/// @throws std::invalid_argument if data.frf is missing.
Picture cmif_picture(const ReportData& data, const PictureStyle& style = {});

/// Magnitudes of the elements `outputs` x `inputs`, one panel each, all on the same axes: measured and, if available,
/// modelled. Tables "OUTPUT_INPUT.txt" by index: frequency_hz measured [model].
/// @throws std::invalid_argument if data.frf is missing, or if there are too many panels to be legible.
Picture bode_picture(const ReportData& data, const std::vector<Eigen::Index>& outputs,
                     const std::vector<Eigen::Index>& inputs, const PictureStyle& style = {});

/// One element, large: measured, modelled, the residual |G - P| and the standard deviation of G; the phases below.
/// Table "entry.txt": frequency_hz measured [model residual] [deviation]; "phase.txt": frequency_hz and the phases in
/// degrees, NaN where they pass 180.
/// @throws std::invalid_argument if data.frf is missing.
Picture entry_picture(const ReportData& data, Eigen::Index output, Eigen::Index input,
                      const PictureStyle& style = {});

}  // namespace stageid
