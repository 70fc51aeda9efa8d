#include "frf/runs/health_gathering.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include "acquisition/files/file_error.hpp"

namespace stageid {
namespace {

/// At most kHealthLines of the lines: half of them with equal ratios, for the rigid body, half with equal spacing, for
/// the flexible modes.
std::vector<int> thinned(const std::vector<int>& lines) {
  if (std::ssize(lines) <= kHealthLines) return lines;
  std::set<int> chosen;
  const auto half = static_cast<int>(kHealthLines / 2);
  const double first = lines.front();
  const double last = lines.back();
  for (int i = 0; i < half; ++i) {
    const double share = static_cast<double>(i) / (half - 1);
    for (const double wanted :
         {first * std::pow(last / first, share), first + share * (last - first)}) {
      const auto at = std::ranges::lower_bound(lines, static_cast<int>(std::lround(wanted)));
      chosen.insert(at == lines.end() ? lines.back() : *at);
    }
  }
  return {chosen.begin(), chosen.end()};
}

void scan_period(const LogSamples& s, const DriveMask& drive, std::vector<ChannelScan>& scan) {
  for (Eigen::Index c = 0; c < s.sensors.cols(); ++c) scan[c].add(s.sensors.col(c), drive.any());
  for (Eigen::Index c = 0; c < s.actuators.cols(); ++c)
    scan[s.sensors.cols() + c].add(s.actuators.col(c), drive.of_actuator(c));
}

/// Columns of excited `wanted` lines. @pre they are among the excited ones of `lines`
std::vector<Eigen::Index> columns_of(const std::vector<int>& wanted, const SpectrumLines& lines) {
  const auto end = lines.lines.begin() + static_cast<std::ptrdiff_t>(lines.excited);
  std::vector<Eigen::Index> columns;
  for (const int line : wanted)
    columns.push_back(std::lower_bound(lines.lines.begin(), end, line) - lines.lines.begin());
  return columns;
}

/// Transforms the channels that are not `known`, into the rows of Z from `first` on.
void transform_others(const Eigen::MatrixXd& samples, std::vector<Eigen::Index> known,
                      const std::vector<int>& lines, Eigen::Index first, RealDft& dft,
                      Eigen::MatrixXcd& Z) {
  std::ranges::sort(known);
  std::vector<Eigen::Index> others;
  std::ranges::set_difference(first_indices(samples.cols()), known, std::back_inserter(others));
  Eigen::MatrixXcd spectra(std::ssize(others), Z.cols());
  line_spectra(samples, others, lines, 0, dft, spectra);
  Z.middleRows(first, samples.cols())(others, Eigen::all) = spectra;
}

}  // namespace

void HealthPart::begin(const UsedRun& run, const Eigen::MatrixXd& excitation) {
  drive_ = DriveMask(excitation, run.log->info());
  sensors_ = static_cast<Eigen::Index>(run.log->info().sensors.size());
}

void HealthPart::watch_start(const UsedRun& run, const std::vector<int>& lines,
                             const std::vector<Eigen::Index>& sensors, RunWorkspace& w) {
  start_lines_ = lines;
  start_sensors_ = sensors;
  start_transient_periods_ = run.transient_periods;
  Eigen::MatrixXcd start;
  if (run.transient_periods > 0) {
    const auto period = static_cast<std::uint64_t>(w.dft.length());
    try {
      run.log->read(run.index, static_cast<std::uint64_t>(run.transient_periods - 1) * period,
                    period, w.samples);
    } catch (const FormatError&) {
      return;  // damage in unused periods does not matter
    }
    if ((w.samples.marked != 0).any()) return;
    start.resize(std::ssize(sensors), std::ssize(lines));
    line_spectra(w.samples.sensors, sensors, lines, 0, w.dft, start);
  }
  recorder_ = StartRecorder(std::move(start));
}

void HealthPart::end() {
  for (Eigen::Index c = sensors_; c < std::ssize(scan_); ++c) {
    // An actuator that is constant in a run without its excitation has an open loop.
    ChannelScan& scan = scan_[c];
    if (!drive_.excites(c - sensors_) && scan.high().value == scan.low().value)
      scan.forget_constant();
  }
  drive_ = DriveMask();
  start_ = std::exchange(recorder_, StartRecorder()).finish();
}

void HealthPart::take(int period, RunWorkspace& w, const KnownSpectra* known) {
  scan_period(w.samples, drive_, scan_);
  if (recorder_.on() && known != nullptr) {
    recorder_.take(
        known->values.topLeftCorner(std::ssize(start_sensors_), std::ssize(start_lines_)));
  } else if (recorder_.on()) {
    Eigen::MatrixXcd spectra(std::ssize(start_sensors_), std::ssize(start_lines_));
    line_spectra(w.samples.sensors, start_sensors_, start_lines_, 0, w.dft, spectra);
    recorder_.take(spectra);
  }
  if (lines_.empty() || periods_.size() >= most_periods_) return;
  const Eigen::Index n_y = w.samples.sensors.cols();
  Eigen::MatrixXcd Z(n_y + w.samples.actuators.cols(), std::ssize(lines_));
  std::vector<Eigen::Index> sensors;
  std::vector<Eigen::Index> actuators;
  if (known != nullptr) {
    sensors = known->sensors;
    actuators = known->actuators;
    std::vector<Eigen::Index> rows = sensors;
    for (const Eigen::Index a : actuators) rows.push_back(n_y + a);
    Z(rows, Eigen::all) = known->values(Eigen::all, columns_of(lines_, known->lines));
  }
  transform_others(w.samples.sensors, std::move(sensors), lines_, 0, w.dft, Z);
  transform_others(w.samples.actuators, std::move(actuators), lines_, n_y, w.dft, Z);
  periods_.push_back(std::move(Z));
  numbers_.push_back(period);
}

void HealthPart::leave_out() {
  for (ChannelScan& channel : scan_) channel.break_off();
  recorder_.give_up();
}

void HealthPart::forget_deviating(const RunSpectra& run) {
  int of_start = 0;
  for (const int period : run.deviating) {
    if (period == of_start) ++of_start;
    const auto at = std::ranges::find(numbers_, period);
    if (at == numbers_.end() || periods_.size() == 1) continue;
    periods_.erase(periods_.begin() + (at - numbers_.begin()));
    numbers_.erase(at);
  }
  if (of_start < std::ssize(run.deviating) || !run.replaced.empty()) start_ = RunStart();
}

void carry(Parcel& parcel, SampleSlip& slip) {
  parcel(slip.run), parcel(slip.realization), parcel(slip.experiment), parcel(slip.row);
  parcel(slip.lost), parcel(slip.sensors), parcel(slip.actuators), parcel(slip.channel);
  parcel(slip.spoilt);
}

void carry(Parcel& parcel, RunStart& start) {
  parcel(start.along), parcel(start.ending), parcel(start.start);
  parcel(start.first), parcel(start.last), parcel(start.noise);
  parcel(start.periods), parcel(start.start_used);
}

void carry(Parcel& parcel, HealthPart& part) {
  parcel(part.periods_), parcel(part.numbers_), parcel(part.scan_), parcel(part.slips_);
  parcel(part.sensors_), parcel(part.start_lines_), parcel(part.start_sensors_);
  parcel(part.start_transient_periods_), parcel(part.start_);
}

void read_periods(const UsedRun& run, const Eigen::MatrixXd& excitation, RunWorkspace& w,
                  HealthPart* health, const ReadDone& read_done,
                  const std::function<const KnownSpectra*(int period)>& take,
                  const LeaveOut& leave_out) {
  if (health == nullptr) {
    for_each_period(run, w, read_done, take, leave_out);
    return;
  }
  health->begin(run, excitation);
  health->slips_ = for_each_period(
      run, w, read_done, [&](int p) { health->take(p, w, take(p)); },
      [&](int p, const std::string& why) {
        leave_out(p, why);
        health->leave_out();
      });
  health->end();
}

HealthGathering::HealthGathering(const std::vector<RealizationRuns>& realizations) {
  const LogInfo& info = realizations.front().runs.front().log->info();
  record_.info = info;
  record_.scan.resize(info.sensors.size() + info.actuators.size());
  HealthPart empty;
  empty.scan_.resize(record_.scan.size());
  for (const RealizationRuns& realization : realizations) {
    Realization& one = realizations_.emplace_back();
    one.parts.assign(realization.runs.size(), empty);
    one.record.realization = realization.realization;
    for (const UsedRun& used : realization.runs) record_.health += used.run().health;
  }
}

std::size_t HealthGathering::Realization::first_without_spectra() const {
  const auto missing = [](const HealthPart& part) { return part.periods_.empty(); };
  return static_cast<std::size_t>(std::ranges::find_if(parts, missing) - parts.begin());
}

std::size_t HealthGathering::first_without_spectra() const {
  return realizations_[excited_].first_without_spectra();
}

bool HealthGathering::complete() const {
  return std::ranges::any_of(realizations_, &Realization::complete);
}

void HealthGathering::excite(std::size_t realization, const std::vector<RunExcitation>& runs) {
  const bool first = !complete();
  excited_ = realization;
  Realization& one = realizations_[realization];
  RealizationRecord& record = one.record;
  record.axes = excited_axes(runs);
  record.zippered = runs.size() == 1 && runs.front().spectrum.is_zippered();
  one.lines = thinned(runs.front().spectrum.lines);
  for (HealthPart& part : one.parts) {
    part.lines_ = one.lines;
    if (!first) part.most_periods_ = kPeriodsOfOthers;
  }
  record.frequency_hz = frequencies_hz(record_.info, one.lines);
  record.lines.resize(one.lines.size());
  for (std::size_t k = 0; k < one.lines.size(); ++k) {
    const int line = one.lines[k];
    LineRecord& at = record.lines[k];
    at.R.setZero(std::ssize(record_.info.excitation), std::ssize(runs));
    for (std::size_t e = 0; e < runs.size(); ++e) {
      const ExcitationSpectrum& spectrum = runs[e].spectrum;
      const auto found = std::ranges::lower_bound(spectrum.lines, line);
      if (found != spectrum.lines.end() && *found == line)
        at.R.col(e) = spectrum.values.col(found - spectrum.lines.begin());
    }
  }
}

HealthPart& HealthGathering::part(std::size_t realization, std::size_t experiment) {
  return realizations_[realization].parts[experiment];
}

/// Runs with other lines or numbers of periods are skipped, because they would need a separate model.
void HealthGathering::add_start(HealthPart& part) {
  if (part.start_.periods == 0) return;
  StartEvidence& evidence = record_.start;
  if (evidence.runs.empty()) {
    start_lines_ = part.start_lines_;
    evidence.sensors = std::ssize(part.start_sensors_);
    evidence.transient_periods = part.start_transient_periods_;
    evidence.periods = part.start_.periods + (part.start_.start_used ? 1 : 0);
    evidence.frequency_hz = frequencies_hz(record_.info, start_lines_);
  } else if (part.start_lines_ != start_lines_ ||
             part.start_.periods != evidence.runs.front().periods ||
             part.start_.start_used != evidence.runs.front().start_used) {
    return;
  }
  evidence.runs.push_back(std::move(part.start_));
}

void HealthGathering::add(HealthPart& part) {
  for (std::size_t c = 0; c < part.scan_.size(); ++c) record_.scan[c].add(part.scan_[c]);
  record_.slips.insert(record_.slips.end(), part.slips_.begin(), part.slips_.end());
  add_start(part);
}

HealthRecord HealthGathering::finish() {
  bool first = true;
  for (Realization& one : realizations_) {
    for (HealthPart& part : one.parts) add(part);
    if (!one.complete()) continue;
    RealizationRecord& record = one.record;
    Eigen::Index columns = 0;
    for (const HealthPart& part : one.parts) {
      record.periods.push_back(static_cast<int>(part.periods_.size()));
      columns += record.periods.back();
    }
    for (LineRecord& line : record.lines) line.Z.resize(std::ssize(record_.scan), columns);
    Eigen::Index column = 0;
    for (HealthPart& part : one.parts) {
      for (const Eigen::MatrixXcd& spectra : part.periods_) {
        for (std::size_t k = 0; k < record.lines.size(); ++k)
          record.lines[k].Z.col(column) = spectra.col(k);
        ++column;
      }
      part.periods_.clear();
    }
    if (std::exchange(first, false))
      static_cast<RealizationRecord&>(record_) = std::move(record);
    else
      record_.others.push_back(std::move(record));
  }
  return std::move(record_);
}

}  // namespace stageid
