#include "tools/dashboard/live_response.hpp"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <exception>
#include <map>
#include <set>

#include "acquisition/files/counted.hpp"
#include "acquisition/formats/open_log.hpp"
#include "acquisition/record/log_reader.hpp"
#include "frf/plant/zippered_fit.hpp"
#include "frf/response/confidence.hpp"
#include "tools/report/report_json.hpp"
#include "tools/terminal/exit_code.hpp"

namespace stageid {
namespace {

constexpr int kLowest = 19;

std::string page_json(const FrfEstimate& frf) {
  ReportData data;
  data.cmif_curves = cmif(frf, CmifKind::accelerance);
  data.frf = frf;
  const report::PageContent content = report::page_content(data);
  std::string json = fmt::format(R"({{"realizations":{},"content":{},"blocks":{{)",
                                 frf.realizations, content.json);
  for (std::size_t i = 0; i < content.blocks.size(); ++i)
    json += fmt::format(R"({}"{}":"{}")", i == 0 ? "" : ",", content.blocks[i].id,
                        content.blocks[i].base64);
  return json + "}}";
}

}  // namespace

int complete_realizations(const LogReader& log) {
  std::map<int, std::set<int>> experiments;
  for (const LogRun& run : log.runs())
    if (run.complete) experiments[run.realization].insert(run.experiment);
  const std::size_t needed = is_zippered(log) ? 1 : log.info().excitation.size();
  int complete = 0;
  for (const auto& [realization, done] : experiments) complete += done.size() >= needed ? 1 : 0;
  return complete;
}

LiveResponse::LiveResponse(std::filesystem::path log, FrfOptions options, LatestText& response)
    : log_(std::move(log)), options_(std::move(options)), response_(response) {
  options_.threads = 1;
  options_.realizations.clear();
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void LiveResponse::end_run(const LogRun& run) noexcept {
  if (!run.complete) return;
  const std::lock_guard lock(mutex_);
  ++asked_;
  changed_.notify_all();
}

void LiveResponse::watch() {
  const std::lock_guard lock(mutex_);
  watched_ = true;
  changed_.notify_all();
}

void LiveResponse::catch_up() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return !due(); });
}

std::string LiveResponse::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

std::optional<LiveAccuracy> LiveResponse::accuracy() const {
  const std::lock_guard lock(mutex_);
  return accuracy_;
}

void LiveResponse::set_status(std::string status) {
  const std::lock_guard lock(mutex_);
  status_ = std::move(status);
}

void LiveResponse::run(const std::stop_token& stop) {
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kLowest);
  options_.progress = [&stop](double, double) {
    if (stop.stop_requested()) throw Interrupted();
  };
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return due(); }) && !stop.stop_requested()) {
    const int asked = asked_;
    lock.unlock();
    try {
      update();
    } catch (const std::exception& error) {  // errors must not affect the measurement
      set_status(fmt::format("no response: {}", error.what()));
    }
    lock.lock();
    done_ = asked;
    changed_.notify_all();
  }
}

void LiveResponse::update() {
  if (!std::filesystem::exists(log_)) return;
  const std::unique_ptr<LogReader> log = open_log(log_, false);
  const int complete = complete_realizations(*log);
  if (complete == realizations_) return;
  const FrfEstimate frf = estimate_plant_frf({log.get()}, options_);
  response_.publish(page_json(frf));
  realizations_ = complete;
  const std::optional<double> variance = worst_relative_variance(frf);
  {
    const std::lock_guard lock(mutex_);
    accuracy_.reset();
    if (variance) accuracy_ = {*variance, frf.realizations};
  }
  set_status(fmt::format("from {} of {}", counted(frf.realizations, "realization"),
                         counted(frf.periods, "period")));
}

}  // namespace stageid
