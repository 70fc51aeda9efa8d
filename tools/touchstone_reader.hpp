#pragma once

#include <filesystem>

#include "frf/frf_estimate.hpp"

namespace stageid {

/// Reads Touchstone 1: FILE.sNp of N ports, parameters S, Y, Z, G or H (which is told by nothing but the
/// file), formats RI, MA and DB, frequencies in Hz to GHz. Outputs and inputs are port1 .. portN, unit 1.
/// Noise parameters behind the data of two ports are left out.
/// Source: Touchstone File Format Specification, Rev 1.1 (EIA/IBIS Open Forum, 2002).
/// @throws FileError, FormatError "FILE:LINE: ..."; version 2 is refused.
FrfEstimate read_touchstone(const std::filesystem::path& file);

/// True for the endings .s1p, .s2p, ...
bool is_touchstone(const std::filesystem::path& file);

}  // namespace stageid
