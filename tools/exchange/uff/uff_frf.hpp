#pragma once

#include "frf/response/frf_estimate.hpp"
#include "tools/exchange/arrays/named_array.hpp"
#include "tools/exchange/uff/uff_file.hpp"

namespace stageid {

/// 1, 2, 3 for a channel name that begins with x, y, z or a capital; else 0, a scalar.
int uff_direction(const std::string& channel);

/// A frequency response as one dataset 58 a channel. Channel i of the outputs is node i + 1, of the inputs
/// node 1001 + j; a name that begins with x, y or z gives the direction. What dataset 58 has no place for
/// stands in more of them, of type 0 and with an id line 1 that begins with "stageid": frequencies that
/// single precision does not hold, variances; hold, compensation, sample rate and delay in record 2 of the
/// header. Names are in id lines 4 and 5. Left out: covariances, degrees of freedom, provenance.
/// @throws std::invalid_argument if a name has more than 72 characters.
UffContent uff_of_frf(const FrfEstimate& frf);

/// The frequency responses of a universal file, of ours or of another program: outputs and inputs in order
/// of appearance, named by the entity or by node and direction ("12+Z"), in SI units (dataset 164).
/// @throws FormatError if there is none, a pair of output and input is missing or there twice, lines
/// differ, or units other than SI meet data whose type is not told.
FrfEstimate frf_of_uff(const std::filesystem::path& file, const UffContent& content);

/// Every function as an array, named as above "OUTPUT" (time response) or "OUTPUT<-INPUT", each with its
/// abscissa, "NAME@abscissa": for an import with a map. In the units of the file.
ArrayList arrays_of_uff(const std::filesystem::path& file, const UffContent& content);

}  // namespace stageid
