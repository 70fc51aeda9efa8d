#pragma once

#include "acquisition/files/hdf5_file.hpp"
#include "frf/response/frf_estimate.hpp"

/// The quality datasets of frf.h5: detection lines, linearity test and discarded periods. All are
/// optional.
namespace stageid {

void write_quality(Hdf5File& file, const FrfEstimate& frf);

/// Reads into `frf`, whose channels and frequencies must have been read. @throws FormatError
void read_quality(const Hdf5File& file, FrfEstimate& frf);

}  // namespace stageid
