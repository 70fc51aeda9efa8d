#pragma once

#include <cstddef>
#include <string>

#include "estimation/problem/fit_options.hpp"
#include "frf/response/frf_estimate.hpp"

namespace stageid {

/// Ends a search for modes that only models what is none: every mode that it adds lowers the cost by more than its
/// parameters are worth, and still the search does not come to its end.
///
/// Two signs are watched. A delay, where none is estimated: one more parameter for the model without the modes that
/// were added is worth more (BIC) than all of them. And rounds in a row that added no resonance: nothing but modes
/// beside the lines, broader than resonances are, or within the half-power width of another that is not; or modes that
/// one line each is all the evidence for, as an outlier is. Real modes look like that too, but not so many in a row.
class GrowthWatch {
 public:
  /// Looks at `now` after a round that put the last `added` submodels into it.
  /// @param before the round   @param options those of the fits of the search
  /// @returns true if the search is to end, with model()
  bool ends(const FrfEstimate& frf, const FitOptions& options, const FitResult& before,
            const FitResult& now, std::size_t added);

  /// A search that goes on after it was cut back: rounds before no longer stand in a row with those to come.
  void cut() noexcept { spurious_in_a_row_ = 0; }

  /// Adds why it ended the search, if it did.
  void tell(FitResult& result) const;

  bool ended() const noexcept { return !finding_.empty(); }
  bool by_delay() const noexcept { return by_delay_; }
  /// What to go back to.
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
