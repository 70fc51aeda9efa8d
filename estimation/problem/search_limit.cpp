#include "estimation/problem/search_limit.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace stageid {
namespace {

// The cost of functions is proportional to entries, that of their products to pairs of columns. The ratio is from
// operation counts; the scale is from the search of a stage with 7 x 17 channels and 4000 lines, where 30 s in these
// units took about 30 s of processor time.
constexpr double kSecondsPerEntry = 5e-10;
constexpr double kSecondsPerProduct = 5e-11;

constexpr double kCompletionPart = 0.5;  // of the budget

}  // namespace

SearchLimit::SearchLimit(double seconds, std::function<bool()> interrupted)
    : budget_s_(seconds > 0.0 ? seconds : std::numeric_limits<double>::infinity()),
      allowed_s_(budget_s_),
      interrupted_(std::move(interrupted)) {}

void SearchLimit::add(double lines, double channels, double columns) noexcept {
  spent_s_ += lines * channels * columns * (kSecondsPerEntry + kSecondsPerProduct * columns);
}

void SearchLimit::begin_completion() noexcept {
  allowed_s_ = std::max(allowed_s_, spent_s_ + kCompletionPart * budget_s_);
}

FitStatus SearchLimit::status() const {
  return was_interrupted() ? FitStatus::interrupted : FitStatus::search_budget;
}

const char* SearchLimit::message() const {
  return was_interrupted() ? "interrupted: this is the best model so far"
                           : "the search reached its budget: this is the best model so far";
}

bool ended_by_limit(const FitResult& fit) noexcept {
  return fit.status() == FitStatus::search_budget || fit.status() == FitStatus::interrupted;
}

}  // namespace stageid
