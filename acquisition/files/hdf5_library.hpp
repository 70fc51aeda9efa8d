#pragma once

namespace stageid {

/// Call before the first use of HDF5, also through other libraries (libmatio). HDF5 would print its error stack on
/// stderr; stageid puts the reason into the exception instead. HDF5's clean-up at exit is disabled: it crashes on a
/// file that could not be closed because the disk is full, and all handles close themselves.
void prepare_hdf5() noexcept;

}  // namespace stageid
