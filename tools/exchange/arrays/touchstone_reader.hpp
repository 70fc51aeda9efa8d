#pragma once

#include <filesystem>
#include <string>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

struct TouchstoneFrf {
  FrfEstimate frf;
  std::string note;  ///< how the reference resistance was removed from parameters other than S
};

/// Reads Touchstone 1: FILE.sNp of N ports, parameters S, Y, Z, G or H, formats RI, MA and DB, frequencies in Hz to
/// GHz. Outputs and inputs are port1 .. portN. S parameters have unit 1. Z, Y, H and G parameters, which version 1
/// normalises to the reference resistance, become V/A and A/V: outputs and inputs are the voltages and currents of the
/// ports. Noise parameters after the data of two ports are ignored.
/// Source: Touchstone File Format Specification, Rev 1.1 (EIA/IBIS Open Forum, 2002).
/// @throws FileError, FormatError "FILE:LINE: ..."; version 2 is unsupported.
TouchstoneFrf read_touchstone(const std::filesystem::path& file);

/// True for the extensions .s1p, .s2p, ...
bool is_touchstone(const std::filesystem::path& file);

}  // namespace stageid
