#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

enum class CovarianceKind : std::uint8_t { diagonal, full };
template <>
inline constexpr std::array kWords<CovarianceKind> = {"diagonal", "full"};

enum class PeriodChoice : std::uint8_t {
  /// Replaces short glitches and excludes periods with a disturbance or a transient; lpm: excludes those with a glitch.
  consistent,
  unmarked  ///< all without a marked sample
};
template <>
inline constexpr std::array kWords<PeriodChoice> = {"consistent", "unmarked"};

class Team;

struct FrfOptions {
  std::vector<std::string> inputs{};       ///< actuator names; empty: the excited ones
  std::vector<std::string> outputs{};      ///< sensor names; empty: all
  std::optional<int> transient_periods{};  ///< instead of the log's own, or of 0 with lpm
  FrfMethod method = FrfMethod::periodic;
  CovarianceKind covariance = CovarianceKind::diagonal;
  PeriodChoice periods = PeriodChoice::consistent;
  int covariance_lines = 1;         ///< number of lines for smooth_covariance(), odd
  std::vector<int> realizations{};  ///< 0-based; empty: all complete ones
  int threads = 0;                  ///< 0: one per core; does not affect the result
  const Team* team = nullptr;       ///< of processes that share the runs; null: one
  /// In bytes; called from one thread at a time.
  std::function<void(double done, double total)> progress{};
};

}  // namespace stageid
