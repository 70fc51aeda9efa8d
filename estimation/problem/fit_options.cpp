#include "estimation/problem/fit_options.hpp"

namespace stageid {

const char* to_string(Weighting weighting) noexcept {
  switch (weighting) {
    case Weighting::unit:
      return "unit";
    case Weighting::inverse_magnitude:
      return "inverse_magnitude";
    case Weighting::relative:
      return "relative";
    case Weighting::noise_variance:
      return "noise_variance";
    case Weighting::total_variance:
      return "total_variance";
    case Weighting::likelihood:
      return "likelihood";
    case Weighting::user:
      return "user";
  }
  return "unit";
}

const char* to_string(FitMethod method) noexcept {
  switch (method) {
    case FitMethod::riv:
      return "riv";
    case FitMethod::gn:
      return "gn";
    case FitMethod::sk:
      return "sk";
  }
  return "riv";
}

const char* to_string(FitStatus status) noexcept {
  switch (status) {
    case FitStatus::gradient_small:
      return "gradient_small";
    case FitStatus::step_small:
      return "step_small";
    case FitStatus::cost_stalled:
      return "cost_stalled";
    case FitStatus::iteration_limit:
      return "iteration_limit";
    case FitStatus::singular:
      return "singular";
    case FitStatus::undetermined:
      return "undetermined";
    case FitStatus::unexplained:
      return "unexplained";
    case FitStatus::faulty_data:
      return "faulty_data";
    case FitStatus::search_budget:
      return "search_budget";
    case FitStatus::interrupted:
      return "interrupted";
  }
  return "singular";
}

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
