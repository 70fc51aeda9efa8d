#pragma once

#include <string>

namespace stageid {

/// While an FftWisdom exists, RealDft plans by timing. Otherwise its plans depend only on the length. See
/// docs/decisions/determinism.md.
class FftWisdom {
 public:
  /// Loads plans that text() returned earlier; empty: none. Only one may exist; create it before the RealDfts.
  /// @throws std::invalid_argument if the plans are from another version of FFTW or another kind of processor.
  /// @throws std::logic_error if an FftWisdom exists already.
  explicit FftWisdom(const std::string& plans);
  ~FftWisdom();  ///< discards the timed plans; existing RealDfts keep theirs
  FftWisdom(FftWisdom&&) = delete;

  /// All known plans: FFTW's wisdom with sorted entries.
  std::string text() const;
};

}  // namespace stageid
