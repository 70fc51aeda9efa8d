#include "frf/runs/run_periods.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <utility>

#include "frf/periods/period_slip.hpp"

namespace stageid {
namespace {

/// Rotates the rows so that row `by` becomes the first one.
void turn(Eigen::MatrixXd& samples, Eigen::Index by) {
  if (by == 0) return;
  for (Eigen::Index c = 0; c < samples.cols(); ++c)
    std::rotate(samples.col(c).begin(), samples.col(c).begin() + by, samples.col(c).end());
}

class PeriodReading {
 public:
  PeriodReading(const UsedRun& used, RunWorkspace& w) : used_(used), w_(w), N_(w.dft.length()) {}

  /// Reads period p into `out`, displaced by the samples lost before it.
  void read(int p, LogSamples& out) {
    read_displaced(p, lost_of_sensors_, out);
    if (lost_of_actuators_ != lost_of_sensors_) {
      std::swap(out.sensors, w_.other.sensors);
      std::swap(out.marked, w_.other.marked);
      read_displaced(p, lost_of_actuators_, out);
      out.marked = out.marked.max(w_.other.marked);
      std::swap(out.sensors, w_.other.sensors);
    }
    for (const OwnLoss& own : own_losses_) {
      read_displaced(p, own.lost + (own.of_sensors ? lost_of_sensors_ : lost_of_actuators_),
                     w_.other);
      out.marked = out.marked.max(w_.other.marked);
      if (own.of_sensors)
        out.sensors.col(own.channel) = w_.other.sensors.col(own.channel);
      else
        out.actuators.col(own.channel) = w_.other.actuators.col(own.channel);
    }
  }

  SampleSlip note(const PeriodSlip& slip, int earlier, int later) {
    const int period = slip.in_earlier ? earlier : later;
    SampleSlip noted;
    noted.run = used_.run().name;
    noted.realization = used_.run().realization;
    noted.experiment = used_.run().experiment;
    std::int64_t lost = slip.sensors ? lost_of_sensors_ : lost_of_actuators_;
    OwnLoss* own = slip.channel >= 0 ? &own_loss(slip) : nullptr;
    if (own != nullptr) lost += own->lost;
    noted.row = static_cast<std::uint64_t>(
        std::max<std::int64_t>(0, (used_.transient_periods + period) * N_ + slip.row - lost));
    noted.lost = slip.lost;
    noted.sensors = slip.sensors;
    noted.actuators = slip.actuators;
    noted.spoilt = slip.row > 0;
    if (own != nullptr) {
      const LogInfo& info = used_.log->info();
      noted.channel = (slip.sensors ? info.sensors : info.actuators).name(slip.channel);
      own->lost += slip.lost;
      return noted;
    }
    if (slip.sensors) lost_of_sensors_ += slip.lost;
    if (slip.actuators) lost_of_actuators_ += slip.lost;
    return noted;
  }

 private:
  /// Samples that one channel lost in addition to its kind.
  struct OwnLoss {
    bool of_sensors = true;
    Eigen::Index channel = 0;
    std::int64_t lost = 0;
  };

  OwnLoss& own_loss(const PeriodSlip& slip) {
    for (OwnLoss& own : own_losses_)
      if (own.of_sensors == slip.sensors && own.channel == slip.channel) return own;
    return own_losses_.emplace_back(OwnLoss{slip.sensors, slip.channel, 0});
  }

  void read_displaced(int p, std::int64_t lost, LogSamples& out) const {
    const auto samples = static_cast<std::int64_t>(used_.run().samples);
    const std::int64_t wanted = (used_.transient_periods + p) * N_ - lost;
    const std::int64_t first = std::clamp<std::int64_t>(wanted, 0, samples - N_);
    used_.log->read(used_.index, static_cast<std::uint64_t>(first), static_cast<std::uint64_t>(N_),
                    out);
    const std::int64_t by = (((wanted - first) % N_) + N_) % N_;
    turn(out.sensors, by);
    turn(out.actuators, by);
  }

  const UsedRun& used_;
  RunWorkspace& w_;
  std::int64_t N_;
  std::int64_t lost_of_sensors_ = 0;
  std::int64_t lost_of_actuators_ = 0;
  std::vector<OwnLoss> own_losses_;
};

/// Calls take(p) with the actuators' steps in the workspace's samples, unless an earlier estimate has left p out.
void take_or_leave_out(const UsedRun& used, int p, RunWorkspace& w,
                       const std::function<void(int)>& take, const LeaveOut& leave_out) {
  if (used.earlier == nullptr) return take(p);
  for (const DroppedPeriod& d : used.earlier->dropped)
    if (d.realization == used.run().realization && d.experiment == used.run().experiment &&
        d.period == p)
      return leave_out(p, d.reason);
  const Eigen::MatrixXd commands = w.samples.actuators;
  for (const ActuatorStep& s : used.earlier->steps)
    for (double& command : w.samples.actuators.col(s.actuator)) command = s.applied(command);
  take(p);
  w.samples.actuators = commands;
}

}  // namespace

// A period is taken only after the next one has been compared with it, because a gap in the first period shows only
// there. The waiting period is in w.ahead; if there is none, the next period is compared with the last one taken, in
// w.samples.
std::vector<SampleSlip> for_each_period(const UsedRun& used, RunWorkspace& w,
                                        const ReadDone& read_done,
                                        const std::function<void(int period)>& take,
                                        const LeaveOut& leave_out) {
  PeriodReading reading(used, w);
  std::vector<SampleSlip> slips;
  std::optional<int> waiting;
  bool any_taken = false;
  const auto take_waiting = [&] {
    if (!waiting) return;
    std::swap(w.samples, w.ahead);
    any_taken = true;
    take_or_leave_out(used, *waiting, w, take, leave_out);
    waiting.reset();
  };
  for (int p = 0; p < used.periods; ++p) {
    LogSamples& next = waiting ? w.samples : w.ahead;
    reading.read(p, next);
    read_done(static_cast<double>(next.actuators.size() + next.sensors.size()) * sizeof(double));
    if ((next.marked != 0).any()) {
      take_waiting();
      leave_out(p, "a marked sample");
      continue;
    }
    std::optional<PeriodSlip> slip;
    if (waiting || any_taken) slip = find_slip(waiting ? w.ahead : w.samples, next, w.dft);
    if (slip) {
      const SampleSlip noted = reading.note(*slip, waiting.value_or(p - 1), p);
      slips.push_back(noted);
      if (noted.spoilt && !slip->in_earlier) {
        take_waiting();
        leave_out(p, to_string(noted));
        continue;
      }
      reading.read(p, next);
      if (noted.spoilt && waiting) {
        leave_out(*waiting, to_string(noted));
        waiting.reset();
        std::swap(w.samples, w.ahead);
      }
    }
    take_waiting();
    waiting = p;
  }
  take_waiting();
  return slips;
}

}  // namespace stageid
