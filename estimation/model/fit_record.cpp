#include "estimation/model/fit_record.hpp"

#include <algorithm>
#include <utility>

namespace stageid {
namespace {

/// 0: the fit can be trusted
int gravity(std::optional<FitStatus> status) noexcept {
  if (!status) return 0;
  switch (*status) {
    case FitStatus::gradient_small:
    case FitStatus::step_small:
      return 0;
    case FitStatus::undetermined:
      return 1;
    case FitStatus::unexplained:
      return 2;
    case FitStatus::search_budget:
      return 4;
    case FitStatus::faulty_data:
      return 5;
    case FitStatus::interrupted:
      return 6;  // the request of the user comes first
    default:
      return 3;
  }
}

/// In a message; smaller comes first.
int rank_of(const FitReason& reason) noexcept {
  const int rank = -gravity(reason.status);
  const bool by_user_or_data = rank <= -gravity(FitStatus::faulty_data);
  return reason.flags.empty() || by_user_or_data ? rank : -gravity(FitStatus::faulty_data) + 1;
}

}  // namespace

bool FitRecord::trustworthy() const noexcept { return gravity(status) == 0; }

std::vector<FitReason> FitRecord::why() const {
  if (!reasons.empty() || trustworthy()) return reasons;
  return {{*status, message.empty() ? "the fit ended with status " + status_word() : message}};
}

void FitRecord::distrust(FitReason reason) {
  reasons = why();
  if (gravity(reason.status) > gravity(status)) status = reason.status;
  const bool known = !reason.flags.empty() &&
                     std::ranges::find(reasons, reason.flags, &FitReason::flags) != reasons.end();
  if (!known) reasons.push_back(std::move(reason));
  std::ranges::stable_sort(reasons, {}, rank_of);
  message.clear();
  for (const FitReason& one : reasons) message += (message.empty() ? "" : "; ") + one.text();
}

}  // namespace stageid
