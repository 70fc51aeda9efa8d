#pragma once

#include "frf/response/frf_estimate.hpp"
#include "tools/exchange/arrays/named_array.hpp"
#include "tools/exchange/uff/uff_file.hpp"

namespace stageid {

/// 1, 2, 3 for a channel name that begins with x, y, z or a capital; else 0, a scalar.
int uff_direction(const std::string& channel);

/// A frequency response as one dataset 58 per channel. Channel i of the outputs is node i + 1, channel j of the inputs
/// node 1001 + j; a name that begins with x, y or z gives the direction. Further datasets 58 of type 0, with an id
/// line 1 that begins with "stageid", contain data without a place in the format: frequencies that single precision
/// cannot represent, and variances. Hold, compensation, sample rate and delay are in record 2 of the header, names in
/// id lines 4 and 5. Covariances, degrees of freedom and provenance are not included.
/// @throws std::invalid_argument if a name has more than 72 characters.
UffContent uff_of_frf(const FrfEstimate& frf);

/// The frequency responses of a universal file from stageid or another program: outputs and inputs in order of
/// appearance, named by the entity or by node and direction ("12+Z"), in SI units (dataset 164).
/// @throws FormatError if there is none, a pair of output and input is missing or a duplicate, lines differ, or the
/// units are not SI and the type of the data is unknown.
FrfEstimate frf_of_uff(const std::filesystem::path& file, const UffContent& content);

/// Every function as an array, named "OUTPUT" (time response) or "OUTPUT<-INPUT", each with its abscissa,
/// "NAME@abscissa", for an import with a map. In the units of the file.
ArrayList arrays_of_uff(const std::filesystem::path& file, const UffContent& content);

}  // namespace stageid
