#include "estimation/model/fit_record.hpp"

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

}  // namespace

bool FitRecord::trustworthy() const noexcept { return gravity(status) == 0; }

void FitRecord::distrust(FitStatus why, const std::string& reason) {
  const bool graver = gravity(why) > gravity(status);
  if (trustworthy())
    message = reason;
  else if (graver)
    message = reason + "; " + message;
  else
    message += "; " + reason;
  if (graver) status = why;
}

}  // namespace stageid
