#pragma once

#include <Eigen/Core>
#include <cstddef>

// The numbers that the decisions of the search depend on, each once. The price of a mode, the tolerance of a trial and
// the limit of a determined pole (a standard deviation as large as the value) follow from the criterion.

namespace stageid {

// How far a trial goes.

/// Iterations of a trial: enough to show the gain of a mode or a structure. A mode that still moves is finished later.
inline constexpr int kGrowthIterations = 12;
/// Times as many for delays per channel and for springs, whose start is farther away.
inline constexpr int kFartherAway = 3;
/// A new search is given up if, after a third of its iterations, its cost is this many times that of the model.
inline constexpr double kHopeless = 10.0;
/// Alternatives tried before the search concludes that none is better: missing modes, merges, pairs.
inline constexpr std::size_t kTried = 4;
/// Models of many modes grow by a fifth at a time.
inline constexpr std::size_t kShareAtOnce = 5;

// The part of the data on which moves are tried (structure_study: the same moves as on all data).

inline constexpr Eigen::Index kTrialLines = 500;        ///< at least
inline constexpr Eigen::Index kTrialLinesOfAMode = 20;  ///< at least, per mode
inline constexpr Eigen::Index kTrialChannels = 256;     ///< at most, if an input has no more

// When the search or its last fit ends.

/// Rounds in a row that add no resonance. A measured aircraft, which is nonlinear, has five before convergence.
inline constexpr int kMostSpurious = 6;
/// A model with this many times the cost does not follow the data: a fit that has not converged is better.
inline constexpr double kDearest = 1.5;
/// Times the tolerance: a fit that ends by its number of iterations so near to the stationary point has converged if
/// all its modes are determined. With the default tolerance, its error is a hundredth of a standard deviation.
inline constexpr double kNearly = 100.0;
/// Of 2 ln(likelihood), which has a standard deviation above 1: acceptable cost of convergence.
inline constexpr double kNothing = 0.1;
/// Standard deviations of a chi-square variable: more is not chance.
inline constexpr double kClearly = 3.0;

// More modes than this are placed at once before growing: those hidden by noise never settle.

inline constexpr int kMostGrown = 40;
inline constexpr int kIterationsOfMany = 6;  ///< with free poles
/// Of the standard deviation per pole, root mean square: settled, if many modes or several ways are compared.
inline constexpr double kSettled = 0.02;

// Resonances.

/// A mode of this damping ratio or more has no peak of its own.
inline constexpr double kBroad = 0.1;
/// Deviation of a frequency that is not known, in half-power widths.
inline constexpr double kUndoubtedWidths = 0.1;
/// Of the lowest line: start of a suspension that is hardly distinguishable from a free body.
inline constexpr double kWeakSpringsStart = 0.02;

// Real poles of requested submodels start on a grid that extends beyond the lines by these factors.

inline constexpr int kRealPoleGrid = 17;
inline constexpr double kRealPoleBelow = 0.3;
inline constexpr double kRealPoleAbove = 3.0;

}  // namespace stageid
