#pragma once

#include <functional>

#include "estimation/problem/fit_options.hpp"

namespace stageid {

/// Ends a search before it is complete, by a budget or an interrupt. All fits of one search share it: none of them
/// takes another step after it is reached, and the best model so far is completed.
///
/// The budget counts work, not time. The same data and request give the same model on any machine and with any number
/// of threads.
class SearchLimit {
 public:
  /// @param seconds of a typical core, see add(); 0: unlimited
  /// @param interrupted called between the steps of a fit; empty: never
  explicit SearchLimit(double seconds, std::function<bool()> interrupted = {});

  /// Counts one evaluation of a model on all lines and channels of its data.
  /// @param columns functions and derivatives per channel
  void add(double lines, double channels, double columns) noexcept;

  /// Lets the last fit of a search use a part of the budget beyond the work of the search.
  void begin_completion() noexcept;

  bool reached() const { return spent_s_ >= allowed_s_ || was_interrupted(); }
  bool was_interrupted() const { return interrupted_ && interrupted_(); }
  /// The reason: FitStatus::interrupted or FitStatus::search_budget.
  FitStatus status() const;
  /// The same as a sentence.
  const char* message() const;
  /// In seconds of a typical core.
  double budget_s() const noexcept { return budget_s_; }

 private:
  double budget_s_;
  double allowed_s_;
  double spent_s_ = 0.0;
  std::function<bool()> interrupted_;
};

/// Whether a fit is the best model of a search that was ended by its limit.
bool ended_by_limit(const FitResult& fit) noexcept;

}  // namespace stageid
