#pragma once

#include <functional>
#include <memory>

#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// What ends a search before it has found its own end: a budget, or an interrupt. All fits of one search share it;
/// none of them steps any further once it is reached, and the best model so far is completed.
///
/// The budget is counted in work, not by the clock: the same data and request give the same model, however fast the
/// machine and whatever the number of threads.
class SearchLimit {
 public:
  /// @param seconds of an ordinary core, see add(); 0: no end
  /// @param interrupted looked at between the steps of a fit; empty: never
  explicit SearchLimit(double seconds, std::function<bool()> interrupted = {});

  /// The evaluation of a model on all lines and channels of its data.
  /// @param columns functions and derivatives that every channel sees
  void add(double lines, double channels, double columns) noexcept;

  /// Lets the last fit of a search take a part of the budget beyond what the search has spent.
  void begin_completion() noexcept;

  bool reached() const { return spent_s_ >= allowed_s_ || was_interrupted(); }
  bool was_interrupted() const { return interrupted_ && interrupted_(); }
  /// Why it was reached: FitStatus::interrupted or FitStatus::search_budget.
  FitStatus status() const;
  /// The same as a sentence.
  const char* message() const;
  /// In seconds of an ordinary core.
  double spent_s() const noexcept { return spent_s_; }
  double budget_s() const noexcept { return budget_s_; }

 private:
  double budget_s_;
  double allowed_s_;
  double spent_s_ = 0.0;
  std::function<bool()> interrupted_;
};

/// Whether a fit is the best model of a search that did not come to its own end.
bool ended_by_limit(const FitResult& fit) noexcept;

}  // namespace stageid
