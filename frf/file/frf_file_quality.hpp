#pragma once

#include "acquisition/files/hdf5_file.hpp"
#include "frf/response/frf_estimate.hpp"

/// The part of frf.h5 that says how good the measurement was: detection lines, the test of linearity
/// and the periods that were left out. All of it is optional.
namespace stageid {

void write_quality(Hdf5File& file, const FrfEstimate& frf);

/// Into `frf`, whose channels and frequencies are read already. @throws FormatError
void read_quality(const Hdf5File& file, FrfEstimate& frf);

}  // namespace stageid
