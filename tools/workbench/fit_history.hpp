#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "estimation/request/fit_request.hpp"
#include "excitation/words/words.hpp"

namespace stageid {

struct FitDetails;

/// How far a fit of the workbench is.
enum class FitStage : std::uint8_t {
  waiting,
  linear,    ///< a preview, see warm_start()
  improved,  ///< a better one, see improved()
  refined,   ///< what `stageid fit` writes
  stopped,   ///< by the user: the preview remains
  failed
};
template <>
inline constexpr std::array kWords<FitStage> = {"waiting", "linear",  "improved",
                                                "refined", "stopped", "failed"};

/// One fit of the workbench: what was requested, and the result so far.
struct FitState {
  std::string what;  ///< the edit that led here
  FitRequest request;
  FitStage stage = FitStage::waiting;
  std::shared_ptr<const AdditiveModel> model = nullptr;  ///< null: none yet
  std::vector<double> cost = {};                         ///< of the refinement so far
  std::string message = {};                              ///< how the fit ended, or why it failed
  std::filesystem::path saved = {};                      ///< the model file; empty: not saved
  std::shared_ptr<const FitDetails> details = nullptr;   ///< null: none yet

  bool needs_fit() const noexcept {
    return stage == FitStage::waiting || stage == FitStage::linear || stage == FitStage::improved;
  }
};

/// The fits of a session in their order, with undo and redo. Never empty.
class FitHistory {
 public:
  static constexpr std::size_t kMost = 200;

  explicit FitHistory(FitState first) { states_.push_back(std::move(first)); }
  /// Appends after the current state and makes it current. Forgets the undone states, and beyond kMost the oldest ones
  /// after the first.
  void push(FitState state) {
    states_.resize(index_ + 1);
    if (states_.size() >= kMost) states_.erase(states_.begin() + 1);
    states_.push_back(std::move(state));
    index_ = states_.size() - 1;
  }
  /// @returns false if there is no such state
  bool go(std::size_t index) {
    if (index >= states_.size()) return false;
    index_ = index;
    return true;
  }
  bool undo() { return index_ > 0 && go(index_ - 1); }
  bool redo() { return go(index_ + 1); }

  std::size_t index() const noexcept { return index_; }
  const std::vector<FitState>& states() const noexcept { return states_; }
  FitState& current() noexcept { return states_[index_]; }
  /// The state with this model; null: it is forgotten.
  FitState* of(const AdditiveModel* model) noexcept {
    const auto found =
        std::ranges::find(states_, model, [](const FitState& s) { return s.model.get(); });
    return found == states_.end() ? nullptr : &*found;
  }
  const FitState& current() const noexcept { return states_[index_]; }

 private:
  std::vector<FitState> states_;
  std::size_t index_ = 0;
};

}  // namespace stageid
