#pragma once

#include <string>

namespace stageid {

/// While one exists, RealDft plans by timing. Without one, RealDft's plans depend on nothing but the length. See
/// docs/decisions/determinism.md.
class FftWisdom {
 public:
  /// Takes over plans that text() returned earlier; empty: none. One at a time, made before the RealDfts.
  /// @throws std::invalid_argument if the plans are of another version of FFTW or kind of processor.
  /// @throws std::logic_error if there is one already.
  explicit FftWisdom(const std::string& plans);
  ~FftWisdom();  ///< timed plans are forgotten; RealDfts that exist keep theirs
  FftWisdom(const FftWisdom&) = delete;
  FftWisdom& operator=(const FftWisdom&) = delete;

  /// All plans known now: FFTW's wisdom, its entries sorted.
  std::string text() const;
};

}  // namespace stageid
