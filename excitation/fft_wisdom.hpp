#pragma once

#include <filesystem>
#include <string>

namespace stageid {

/// While one lives, RealDft plans by timing, and what was timed is kept in a file: planning is paid
/// once for each length. With the same file every run has the same plans and so the same bytes; without
/// one, RealDft's plans depend on nothing. See docs/decisions/determinism.md.
///
/// File: a line "stageid-fft-wisdom 1 HEX" with the fingerprint of what follows, then FFTW's wisdom, its
/// entries sorted. It belongs to the version of FFTW and the kind of processor that wrote it.
class FftWisdom {
 public:
  /// Takes over the plans in `file` if it is there. One at a time, made before the RealDfts.
  /// @throws FileError if it cannot be read, or is not there and cannot be made.
  /// @throws FormatError if it is damaged, or of another FFTW or processor.
  /// @throws std::logic_error if there is one already.
  explicit FftWisdom(std::filesystem::path file);
  ~FftWisdom();  ///< timed plans are forgotten; RealDfts that exist keep theirs
  FftWisdom(const FftWisdom&) = delete;
  FftWisdom& operator=(const FftWisdom&) = delete;

  /// Writes the file, whole or not at all, if plans were made that it lacked. Of several programs that
  /// write at once the last one's plans stay.
  /// @returns the fingerprint of the plans. @throws FileError
  std::string save();

 private:
  std::filesystem::path file_;
  std::string kept_;  ///< what the file holds; empty if there is none
};

}  // namespace stageid
