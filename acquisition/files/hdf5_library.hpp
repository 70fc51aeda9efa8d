#pragma once

namespace stageid {

/// Before the first call of HDF5, by us or by a library that uses it (libmatio). HDF5 prints its error stack on stderr
/// unless told not to; we put its reason into the exception. Its own clean-up at exit crashes on a file that a full disk
/// kept from being closed; every handle of ours closes itself.
void prepare_hdf5() noexcept;

}  // namespace stageid
