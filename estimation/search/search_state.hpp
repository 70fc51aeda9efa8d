#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimation/fit/mode_worth.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/search_limit.hpp"
#include "estimation/search/automatic_fit.hpp"
#include "estimation/search/proposed_modes.hpp"

namespace stageid {

/// A search on some data: its request, and the model that it has reached, with its fit and score. Moves change it by
/// adopt(), and say() why.
struct SearchState {
  /// Keeps references to the data and the selection.
  SearchState(const FrfEstimate& of_frf, const ModelStructure& of_model,
              const ModeSelection& of_modes, const FitOptions& of_fit);

  double cost() const { return best.model.fit.cost; }
  double score() const { return worth.criterion(best); }
  bool at_rounding() const { return worth.at_rounding(best); }
  bool limit_reached() const { return options.limit->reached(); }

  /// Whether a fit has a better score than the model.
  bool is_better(const FitResult& fit) const;

  /// Continues from `result`, with its iterations added to the history.
  void adopt(FitResult&& result);

  /// Records a decision.
  template <typename... Args>
  void say(fmt::format_string<Args...> format, Args&&... args) {
    decisions.push_back(fmt::format(format, std::forward<Args>(args)...));
  }

  void take_structure_of(const AdditiveModel& model);
  void take_delay_of(const FitOptions& fit);

  /// The largest modes in the residual.
  const std::vector<ProposedMode>& proposals();

  /// The largest mode in the residual, if it may be worth its parameters.
  std::optional<ModeCandidate> missing_mode();

  int affordable_modes() const { return static_cast<int>(most_modes(frf, structure)); }

  /// Whether the model may reach the cost of its rival with as few parameters, if it gains twice as much per parameter
  /// as since the race began.
  bool may_overtake() const;

  /// Hold, known delays, the submodels besides the modes, and these modes.
  AdditiveModel start_of(const std::vector<ModeCandidate>& modes) const;

  const FrfEstimate& frf;
  const ModeSelection& selection;
  ModelStructure structure;  ///< of `best`, once it is fitted
  FitOptions options;        ///< of the last fit
  FitOptions quick;          ///< of all others
  ModeWorth worth;
  int target;      ///< number of modes to grow to, if it is requested
  int hidden = 0;  ///< modes of `best` whose poles are held because noise hides them

  FitResult best;
  FitResult before;                  ///< the last one before `best` was adopted
  AdditiveModel start;               ///< of the first fit; empty if that was of a part of the data
  std::optional<FitResult> simple;   ///< before modes were added or the structure was changed
  std::optional<FitResult> delayed;  ///< of the start, with a delay that is not allowed
  FitResult proportional;            ///< the last one before general damping
  std::vector<std::string> decisions;
  std::vector<double> history;  ///< costs of all iterations

  /// A race with a model of another structure, from a cost and a number of parameters on.
  struct Race {
    const FitResult* rival;
    double cost;
    Eigen::Index parameters;
  };
  std::optional<Race> race;
  std::string delay_denied;  ///< why the search ended early; empty if it did not

  // Size of the history when no such move was left; with the same model, none is tried again.
  std::size_t merged_at = 0;
  std::size_t structured_at = 0;
  std::size_t exhausted_at = 0;  ///< modes to add

 private:
  std::vector<ProposedMode> proposed_;
  std::size_t proposed_at_ = 0;  ///< size of the history
};

}  // namespace stageid
