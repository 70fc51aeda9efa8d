#pragma once

#include "frf/excitation_spectrum.hpp"
#include "frf/run_spectra.hpp"

namespace stageid {

/// Spectra of one run by the local polynomial method: the whole record is transformed at once and
/// the transient modelled (TransientModel) instead of waited for. Of a run with marked samples the
/// longest stretch of clean periods is used: a record must not have a gap.
/// Memory: the run's samples and spectra of the chosen channels.
/// @throws FormatError if no clean period is left; std::invalid_argument as TransientModel; what
///         LogReader::read() throws.
RunSpectra measure_record(const UsedRun& run, const ExcitationSpectrum& excitation,
                          const ChannelChoice& channels, const Eigen::MatrixXd& excitation_period,
                          RunWorkspace& workspace,
                          const std::function<void(double bytes)>& read_done);

}  // namespace stageid
