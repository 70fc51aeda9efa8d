#include "acquisition/loop/event_recorder.hpp"

#include <algorithm>
#include <bit>

#include "hal/stage/stage.hpp"

namespace stageid {

namespace {

std::int64_t whole(std::uint64_t number) { return static_cast<std::int64_t>(number); }

}  // namespace

std::vector<EventField> event_place(int realization, int experiment) {
  return {{"realization", std::int64_t{realization}}, {"experiment", std::int64_t{experiment}}};
}

void EventRecorder::begin_run(const LogRun& run) noexcept {
  run_ = run;
  cycle_ = 0;
  misses_ = 0;
  open_.reset();
  events_.write("run_begin", event_place(run.realization, run.experiment));
}

void EventRecorder::rows(std::span<const double> rows, std::size_t words) noexcept {
  for (std::size_t at = words - 1; at < rows.size(); at += words)
    take(unpack_status(std::bit_cast<std::uint64_t>(rows[at])));
}

void EventRecorder::take(const SampleStatus& status) noexcept {
  const bool good = static_cast<Outcome>(status.outcome) == Outcome::ok && !status.irregular;
  if (open_ && (good || open_->outcome != status.outcome)) tell_miss();
  if (!good) {
    if (!open_) open_ = {cycle_, 0, status.outcome, 0};
    ++open_->cycles;
    open_->lateness_ns = std::max(open_->lateness_ns, status.lateness_ns);
  }
  ++cycle_;
}

void EventRecorder::tell_miss() noexcept {
  const Miss miss = *open_;
  open_.reset();
  if (++misses_ > kMissesTold) return;
  std::vector<EventField> fields = event_place(run_.realization, run_.experiment);
  fields.push_back({"cycle", whole(miss.cycle)});
  fields.push_back({"cycles", whole(miss.cycles)});
  const auto outcome = static_cast<Outcome>(miss.outcome);
  fields.push_back(
      {"outcome", outcome == Outcome::ok ? "irregular" : std::string(to_string(outcome))});
  fields.push_back({"lateness_s", 1e-9 * miss.lateness_ns});
  events_.write("miss", fields);
}

void EventRecorder::end_run(const LogRun& run) noexcept {
  if (open_) tell_miss();
  std::vector<EventField> fields = event_place(run.realization, run.experiment);
  fields.push_back({"complete", run.complete});
  fields.push_back({"cycles", whole(run.health.cycles)});
  fields.push_back({"late", whole(run.health.late)});
  fields.push_back({"missing", whole(run.health.missing)});
  fields.push_back({"marked", whole(run.health.marked)});
  fields.push_back({"irregular", whole(run.health.irregular)});
  fields.push_back({"misses_not_told", whole(misses_ > kMissesTold ? misses_ - kMissesTold : 0)});
  events_.write("run_end", fields);
}

}  // namespace stageid
