#include "tools/measure/until_variance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <thread>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "frf/response/confidence.hpp"
#include "hal/stage/real_time.hpp"
#include "tools/dashboard/live_response.hpp"

namespace stageid {

UntilVariance::UntilVariance(std::filesystem::path log, FrfOptions options, double variance)
    : log_(std::move(log)), options_(std::move(options)), wanted_(variance) {
  if (!(variance > 0.0) || !std::isfinite(variance))
    fail_request("--until: {} is not a variance; write a positive number, e.g. 1e-6 for 0.1 %",
                 variance);
  options_.realizations.clear();
}

std::string UntilVariance::enough() {
  std::thread worker([this] {
    take_normal_priority();
    try {
      look();
    } catch (const std::exception& error) {  // errors must not end the measurement
      failure_ = error.what();
    }
  });
  worker.join();
  if (!reached_ || *reached_ > wanted_) return "";
  return fmt::format("mean relative variance {:.3g} after {}, target {:.3g}", *reached_,
                     counted(realizations_, "realization"), wanted_);
}

std::string never_enough(const ExperimentSpec& plan, const FrfOptions& options) {
  if (plan.realizations > 1) return "";
  const bool no_noise = plan.periods < 2 && options.method == FrfMethod::periodic;
  return fmt::format(
      "{}, so the experiment will not end early; set realizations to 2 or more",
      no_noise ? "one period of one realization has no variance estimate"
               : "the variance is checked after every realization, and the plan has only one");
}

void UntilVariance::look() {
  reached_.reset();
  failure_.clear();
  const std::unique_ptr<LogReader> log = open_log(log_, false);
  if (complete_realizations(*log) == 0) return;
  const FrfEstimate frf = estimate_plant_frf({log.get()}, options_);
  realizations_ = frf.realizations;
  reached_ = worst_relative_variance(frf);
}

}  // namespace stageid
