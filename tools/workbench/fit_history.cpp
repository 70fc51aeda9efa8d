#include "tools/workbench/fit_history.hpp"

namespace stageid {

void FitHistory::push(FitState state) {
  states_.resize(index_ + 1);
  if (states_.size() >= kMost) states_.erase(states_.begin() + 1);
  states_.push_back(std::move(state));
  index_ = states_.size() - 1;
}

bool FitHistory::go(std::size_t index) {
  if (index >= states_.size()) return false;
  index_ = index;
  return true;
}

}  // namespace stageid
