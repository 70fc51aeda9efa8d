#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "frf/response/frf_estimate.hpp"

namespace stageid {

enum class CovarianceKind : std::uint8_t { diagonal, full };
enum class PeriodChoice : std::uint8_t {
  consistent,  ///< periods with a glitch, a bump or a transient in them are left out; lpm: a glitch
  unmarked     ///< all without a marked sample
};

struct FrfOptions {
  std::vector<std::string> inputs{};       ///< actuator names; empty: those that are excited
  std::vector<std::string> outputs{};      ///< sensor names; empty: all
  std::optional<int> transient_periods{};  ///< instead of the log's own, or of 0 with lpm
  FrfMethod method = FrfMethod::periodic;
  CovarianceKind covariance = CovarianceKind::diagonal;
  PeriodChoice periods = PeriodChoice::consistent;
  int covariance_lines = 1;         ///< smooth_covariance() over so many lines; odd
  std::vector<int> realizations{};  ///< which (0-based); empty: all complete ones
  int threads = 0;                  ///< 0: as many as cores; the result does not depend on it
  std::function<void(double done, double total)>
      progress{};  ///< bytes; called from one thread at a time
};

}  // namespace stageid
