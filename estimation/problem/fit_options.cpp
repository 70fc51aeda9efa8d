#include "estimation/problem/fit_options.hpp"

namespace stageid {

bool is_trustworthy(FitStatus status) noexcept {
  return status == FitStatus::gradient_small || status == FitStatus::step_small;
}

bool is_trustworthy(const FitRecord& record) {
  return record.status.empty() || record.status == to_string(FitStatus::gradient_small) ||
         record.status == to_string(FitStatus::step_small);
}

namespace {

int gravity(FitStatus status) noexcept {
  if (is_trustworthy(status)) return 0;
  if (status == FitStatus::undetermined) return 1;
  if (status == FitStatus::unexplained) return 2;
  if (status == FitStatus::interrupted) return 6;  // the request of the user comes first
  if (status == FitStatus::faulty_data) return 5;
  return status == FitStatus::search_budget ? 4 : 3;
}

}  // namespace

void FitResult::distrust(FitStatus why, const std::string& reason) {
  if (trustworthy()) {
    message = reason;
  } else if (gravity(why) > gravity(status)) {
    message = reason + "; " + message;
  } else {
    message += "; " + reason;
  }
  if (gravity(why) > gravity(status)) status = why;
  model.fit.status = to_string(status);
  model.fit.message = message;
}

}  // namespace stageid
