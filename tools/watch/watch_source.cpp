#include "tools/watch/watch_source.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "acquisition/formats/open_log.hpp"
#include "excitation/multisine/dft.hpp"
#include "frf/runs/excitation_spectrum.hpp"

namespace stageid {
namespace {

/// The excited lines in the band; all lines of the band if the log has no excitation.
std::vector<int> watched_lines(const LogReader& log, const std::array<double, 2>& band_hz) {
  std::vector<int> lines = lines_in_band(log.info(), band_hz[0], band_hz[1]);
  if (log.info().excitation.size() == 0) return lines;
  RealDft dft(log.info().period_samples);
  const std::vector<int> excited = excitation_spectrum(log.excitation(0), dft).lines;
  std::vector<int> both;
  std::ranges::set_intersection(lines, excited, std::back_inserter(both));
  return both;
}

}  // namespace

WatchSource::WatchSource(const AdditiveModel& model, std::filesystem::path log,
                         const std::array<double, 2>& band_hz, bool follow)
    : file_(std::move(log)) {
  open(follow);
  if (log_->runs().empty())
    fail_request("{}: has no run yet; start the measurement first", file_.string());
  const std::vector<int> lines = watched_lines(*log_, band_hz);
  if (lines.size() < 2)
    fail_request(
        "{}: excites fewer than 2 lines between {} and {} Hz, the band of the model; "
        "use another --band, or excite lines in the band",
        file_.string(), band_hz[0], band_hz[1]);
  spectra_.emplace(model, *log_, lines);
  frequency_hz_ = Eigen::VectorXi::Map(lines.data(), std::ssize(lines)).cast<double>() *
                  (log_->info().sample_rate_hz / log_->info().period_samples);
  excitation_ = log_->excitation(0);
  period_ = static_cast<std::uint64_t>(log_->info().transient_periods);
}

bool WatchSource::has_begun(const std::filesystem::path& log) {
  const SlogReader reader(log, false);
  return !reader.runs().empty() || reader.end();
}

void WatchSource::open(bool follow) {
  if (!follow) {
    log_ = open_log(file_);
    return;
  }
  // The last block may be incomplete at this moment.
  auto log = std::make_unique<SlogReader>(file_, false);
  growing_ = log.get();
  log_ = std::move(log);
}

bool WatchSource::has_ended() const { return growing_ == nullptr || growing_->end(); }

bool WatchSource::refresh() {
  if (has_ended()) return false;
  growing_->update();
  return true;
}

bool WatchSource::was_stopped_early() const {
  return has_ended() && !std::ranges::all_of(log_->runs(), &LogRun::complete);
}

std::optional<WatchedPeriod> WatchSource::next() {
  const auto N = static_cast<std::uint64_t>(log_->info().period_samples);
  while (true) {
    const bool whole = (period_ + 1) * N <= log_->runs()[run_].samples;
    if (!whole && run_ + 1 >= log_->runs().size()) return std::nullopt;
    if (!whole) {
      rows_before_ += log_->runs()[run_].samples;
      ++run_;
      period_ = static_cast<std::uint64_t>(log_->info().transient_periods);
      Eigen::MatrixXd excitation = log_->excitation(run_);
      other_excitation_ = other_excitation_ || excitation != excitation_;
      excitation_ = std::move(excitation);
      continue;
    }
    const std::uint64_t period = period_++;
    std::optional<PeriodSpectra> spectra = spectra_->read(*log_, run_, period);
    if (!spectra) {
      ++skipped_;
      continue;
    }
    return WatchedPeriod{
        std::move(*spectra), run_, period,
        static_cast<double>(rows_before_ + (period + 1) * N) / log_->info().sample_rate_hz,
        std::exchange(other_excitation_, false)};
  }
}

}  // namespace stageid
