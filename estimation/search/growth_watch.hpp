#pragma once

#include <cstddef>
#include <string>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Ends a search for modes that fits something else: every added mode lowers the cost by more than its parameters are
/// worth, but the search does not end.
///
/// Two signs are checked. Delay: if none is estimated, and one delay parameter without the added modes is worth more
/// (BIC) than all of them. Spurious rounds in a row: rounds whose modes are outside the lines, at a bound, broader than
/// resonances, within the half-power width of another mode, or supported by only one line each, as outliers are. Real
/// modes can look like that too, but not that many in a row.
class GrowthWatch {
 public:
  /// Checks `now` after a round that appended the last `added` submodels.
  /// @param before the round   @param options of the fits of the search
  /// @returns true if the search should end, with model()
  bool ends(const FrfEstimate& frf, const FitOptions& options, const FitResult& before,
            const FitResult& now, std::size_t added);

  /// For a search that continues after modes were removed: restarts the count of rounds in a row.
  void cut() noexcept { spurious_in_a_row_ = 0; }

  bool ended() const noexcept { return !finding_.empty(); }
  bool by_delay() const noexcept { return by_delay_; }
  /// The model to return to.
  const FitResult& model() const noexcept { return back_to_; }
  const std::string& finding() const noexcept { return finding_; }

 private:
  bool a_delay_explains_more(const FrfEstimate& frf, const FitOptions& options,
                             const FitResult& now);

  int rounds_ = 0;
  int spurious_in_a_row_ = 0;
  FitResult first_;    ///< before the first round
  FitResult back_to_;  ///< before the rounds in a row
  bool by_delay_ = false;
  std::string finding_;
};

}  // namespace stageid
