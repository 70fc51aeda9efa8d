#pragma once

#include <Eigen/Core>
#include <cstddef>

// The numbers that the decisions of the search depend on, each once. The price of a mode, the tolerance of a trial and
// the limit of a determined pole (a standard deviation as large as the value) follow from the criterion.

namespace stageid {

// How far a trial goes.

/// Iterations of a trial: enough to show the gain of a mode or a structure. A mode that still moves is finished later.
inline constexpr int kGrowthIterations = 12;
/// Alternatives tried before the search concludes that none is better: missing modes, merges, pairs.
inline constexpr std::size_t kTried = 4;
/// Models of many modes grow by a fifth at a time.
inline constexpr std::size_t kShareAtOnce = 5;
/// A fit gains at most this many times what the matched filter estimates for a further mode.
inline constexpr double kReach = 5.0;

// The part of the data on which the search begins and moves are tried.

inline constexpr Eigen::Index kPartLines = 500;        ///< at least
inline constexpr Eigen::Index kPartLinesOfAMode = 20;  ///< at least, per mode
inline constexpr Eigen::Index kPartChannels = 128;     ///< at most; the whole stage has 119

// When the search or its last fit ends.

/// Times the iterations of a last fit that ended by their number, although the data determine all its modes.
inline constexpr int kLonger = 3;
/// A model with this many times the cost does not follow the data: a fit that has not converged is better.
inline constexpr double kDearest = 1.5;
/// Standard deviations: more is not chance, even in the largest of a thousand channels (p = 6e-7 each).
inline constexpr double kClearly = 5.0;

// A requested number of modes, some of which noise may hide.

inline constexpr int kIterationsWhileFree = 6;  ///< of all poles, as long as they halve the cost
/// Of the standard deviation per pole, root mean square: settled.
inline constexpr double kSettled = 0.02;

// Resonances.

/// A mode of this damping ratio or more has no peak of its own.
inline constexpr double kBroad = 0.1;
/// Of a half-power width, a damping ratio or a direction: a small change, in which a fit is linear, but which is far
/// above rounding. Also the deviation of a frequency without a standard deviation.
inline constexpr double kSmallPart = 0.1;
/// Of a half-power width or a damping ratio: the largest step from the linear solution that separates two modes.
inline constexpr double kLargestPart = 0.5;
/// Of the lowest line: start of a suspension that is hardly distinguishable from a free body.
inline constexpr double kWeakSpringsStart = 0.02;

/// Starts of a real pole of a requested submodel. Over four decades, two starts differ by a factor below two.
inline constexpr int kRealPoleGrid = 17;

// Of many modes hidden by noise: the part of the best shrinkage (three quarters of the gain for a quarter of the cost),
// and its limit for a mode that is all noise.

inline constexpr double kPartOfShare = 0.5;
inline constexpr double kLargestShare = 0.99;

// Rounding.

/// Of a normal matrix with unit diagonal. One denominator of order 20 reaches 1e-12 (the numerators 1e-9) and is still
/// determined; sums of thousands of terms are accurate to 1e-15.
inline constexpr double kSmallestDirection = 1e-12;  ///< of the numerators
inline constexpr double kSmallestShare = 3e-14;      ///< of the denominators
/// Of the largest entry of a residue: a smaller deviation would only test rounding.
inline constexpr double kBestKnown = 1e-8;
/// Samples: smaller differences of delays are below the accuracy of the hold.
inline constexpr double kLeastSamples = 1e-3;

}  // namespace stageid
