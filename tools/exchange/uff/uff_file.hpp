#pragma once

// Universal files (UFF, .unv, .uff): datasets 151 (header), 164 (units), 58 (function at a nodal degree of freedom,
// text and binary) and 55 (data at nodes). Source: the definitions of SDRC, published by the University of Cincinnati,
// https://www.ceas3.uc.edu/sdrluff/. Other datasets are skipped.

#include <array>
#include <complex>
#include <filesystem>
#include <string>
#include <vector>

namespace stageid {

/// Measurement point of a function: record 6 of dataset 58.
struct UffPoint {
  std::string entity =
      "NONE";  ///< at most 10 ASCII characters: others would shift the following fields
  long long node = 0;
  int direction = 0;  ///< 0 scalar; 1, 2, 3 +X, +Y, +Z; 4, 5, 6 rotations; negative: the other way
};

/// Description of an axis: records 8 to 10.
struct UffAxis {
  int type =
      0;  ///< 8 displacement, 11 velocity, 12 acceleration, 13 excitation force, 17 time, 18 frequency
  std::array<int, 3> exponents = {0, 0, 0};  ///< of length, force, temperature; for types 0 and 1
  std::string unit = "NONE";                 ///< at most 20 characters
  std::string label = "NONE";                ///< at most 20 characters
};

/// Dataset 58: values over time or frequency.
struct UffFunction {
  std::array<std::string, 5> id = {"NONE", "NONE", "NONE", "NONE", "NONE"};
  int type = 0;  ///< 0 unknown, 1 time response, 4 frequency response
  UffPoint response;
  UffPoint reference;
  UffAxis abscissa_axis;
  UffAxis ordinate_axis;
  UffAxis denominator_axis;
  bool complex = false;
  std::vector<double> abscissa;
  std::vector<std::complex<double>> ordinate;  ///< same length as the abscissa
  std::size_t line = 0;                        ///< of the file, 1-based: for errors
};

/// Dataset 55, analysis type 2 (normal mode), 3 or 7 (complex eigenvalue).
struct UffMode {
  std::array<std::string, 5> id = {"NONE", "NONE", "NONE", "NONE", "NONE"};
  int number = 0;
  bool complex = false;
  double frequency_hz = 0.0;        ///< normal mode
  double damping_ratio = 0.0;       ///< normal mode
  double modal_mass = 0.0;          ///< normal mode
  std::complex<double> pole_rad_s;  ///< complex eigenvalue
  std::complex<double> modal_a;     ///< complex eigenvalue
  std::vector<long long> nodes;
  std::size_t values_per_node = 1;           ///< 1 scalar, 3 X Y Z
  std::vector<std::complex<double>> values;  ///< nodes x values_per_node
};

/// Dataset 164. SI = value of the file / factor.
struct UffUnits {
  double length = 1.0;
  double force = 1.0;
};

struct UffContent {
  std::string model_name;   ///< dataset 151, record 1
  std::string description;  ///< record 2
  UffUnits units;           ///< of a read file; SI is written
  std::vector<UffFunction> functions;
  std::vector<UffMode> modes;
};

/// Writes datasets 151, 164, 58 and 55 atomically: for .uff binary (58b: exact; uneven abscissas in double precision, as
/// common readers expect), otherwise text (13 digits, as prescribed (E20.12); abscissas 6 unless evenly spaced). Equal
/// content gives equal bytes; dates are empty. Abscissas are stored as even if minimum and step, written with six digits,
/// reproduce them exactly.
/// @throws std::invalid_argument if an id line is longer than 80 characters, or a unit than 20.
/// @throws FileError
void write_uff(const std::filesystem::path& file, const UffContent& content);

/// Whether the extension is that of a universal file.
bool is_uff_name(const std::filesystem::path& file);

/// Reads text and binary datasets 58 of either byte order, IEEE 754. Binary abscissas may have single precision, as in
/// the specification, or double precision, as written by many programs. Texts that are not UTF-8 are read as Latin-1.
/// @throws FileError, FormatError "FILE:LINE: ...".
UffContent read_uff(const std::filesystem::path& file);

}  // namespace stageid
