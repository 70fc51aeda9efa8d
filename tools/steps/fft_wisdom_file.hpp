#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "excitation/multisine/fft_wisdom.hpp"

namespace stageid {

/// FFT plans that are timed once per length and stored in a file. With the same file, every run has the same plans and
/// therefore the same bytes.
///
/// File: a line "stageid-fft-wisdom 1 HEX" with the fingerprint of the rest, then FftWisdom::text().
class FftWisdomFile {
 public:
  /// Uses the plans in `file` if it exists, see FftWisdom.
  /// @throws FileError if the file cannot be read, or does not exist and cannot be created.
  /// @throws FormatError if the file is damaged, or from another FFTW version or processor.
  explicit FftWisdomFile(std::filesystem::path file);

  /// Writes the file atomically if there are new plans. If several programs write at the same time, the plans of the
  /// last one remain.
  /// @returns the fingerprint of the plans. @throws FileError
  std::string save();

 private:
  std::filesystem::path file_;
  std::string kept_;  ///< plans in the file; empty if it does not exist
  std::unique_ptr<FftWisdom> wisdom_;
};

}  // namespace stageid
