#include "tests/acquisition/days/simulated_day.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <utility>

#include "acquisition/slog/slog_reader.hpp"
#include "acquisition/slog/slog_recover.hpp"
#include "acquisition/slog/slog_scan.hpp"
#include "tests/acquisition/days/day_link.hpp"
#include "tests/acquisition/days/disk_log.hpp"
#include "tests/support/process/temporary_directory.hpp"
#include "tests/support/stages/stop_case.hpp"
#include "tests/support/stages/wafer_stage.hpp"

namespace stageid::test {

namespace {

constexpr int kPeriod = 400;
constexpr double kCounts = 1 << 23;  // of a range in a CAN frame

/// The wafer stage, or one axis whose limits of all kinds are a few times what a healthy experiment needs.
SimulatedSpec day_stage(bool wafer, bool predicted) {
  SimulatedSpec spec = wafer ? wafer_stage_spec() : stop_stage_spec();
  if (!wafer) {
    spec.limits.slew_n_s = Eigen::VectorXd::Constant(1, 6e5);
    spec.limits.thermal_rms_n = Eigen::VectorXd::Constant(1, 100.0);
  }
  spec.limits.thermal_time_constant_s = 0.05;
  spec.limits.motion = predicted
                           ? rigid_motion(spec.controller, spec.info.actuators, spec.info.sensors)
                           : RigidMotion{};
  return spec;
}

ExperimentPlan day_plan(RandomNumbers& random, const SimulatedSpec& stage) {
  const auto last = static_cast<int>(stage.info.actuators.size()) - 1;
  ExperimentSpec spec;
  if (last == 0) {
    spec.axes = {{stage.info.actuators[0].name, 10.0, {}}};
  } else {
    const int first = random.integer(0, last - 1);
    for (const int axis : {first, random.integer(first + 1, last)})
      spec.axes.push_back({stage.info.actuators[static_cast<std::size_t>(axis)].name, 2.0, {}});
    spec.scheme = static_cast<ExcitationScheme>(random.integer(0, 2));
  }
  spec.realizations = random.integer(2, 6);
  spec.periods = random.integer(1, 3);
  spec.transient_periods = random.integer(0, 1);
  spec.seed = static_cast<std::uint64_t>(random.integer(0, 1 << 30));
  return {
      FrequencyGrid::band(stage.info.sample_rate_hz, kPeriod, {.low_hz = 50.0, .high_hz = 1000.0}),
      spec};
}

/// One experiment: a plan, its log and the attempts to complete it.
class DayExperiment {
 public:
  DayExperiment(RandomNumbers& random, const std::filesystem::path& directory, DayReport& report)
      : random_(random),
        link_(static_cast<Link>(random.integer(0, 2))),
        between_runs_(link_ != Link::resident && random.uniform() < 0.3 ? BetweenRuns::hold
                                                                        : BetweenRuns::release),
        stage_(day_stage(random.uniform() < 0.2, random.uniform() < 0.5)),
        plan_(day_plan(random, stage_)),
        directory_(directory),
        file_(directory / "0.slog"),
        report_(report) {}

  void perform() {
    for (int attempts = random_.integer(1, 4); attempts > 0 && !complete(); --attempts)
      attempt(draw_misfortune(random_, link_ != Link::direct, stage_.info, plan_),
              RandomNumbers(random_.number()));
    if (!complete()) attempt({}, RandomNumbers(0));
    if (!complete()) blame("the experiment is not complete after an attempt without trouble");
  }

 private:
  static constexpr double kLoud = 15.0;
  static constexpr double kFarthest = 1.05;  // hard windows: the motion of one sample is beyond

  bool complete() const { return done_.size() == plan_.runs().size(); }

  /// How much is drawn from `random` may depend on when the loop notices that the log has failed.
  void attempt(const Misfortune& misfortune, RandomNumbers random) {
    ++report_.attempts;
    misfortune_ = misfortune.describe();
    for (const Trouble trouble : misfortune.troubles) ++report_.troubles[trouble];
    SimulatedSpec spec = stage_;
    if (misfortune.has(Trouble::stage_fault)) spec.simulation.faults = {misfortune.fault};
    const double gain = misfortune.has(Trouble::loud) ? random.uniform(1.0, kLoud) : 1.0;
    for (AxisController& axis : spec.controller.axes) axis.gain *= gain;
    testimony_ = {};
    DayLink link(spec, link_, misfortune, testimony_, random);
    std::optional<SlogWriter> log = open(experiment_log_info(plan_, spec.info));
    DiskLog disk(*log, misfortune.has(Trouble::disk) ? misfortune.log_call : -1);
    const ExperimentResult result = link.perform(
        plan_, disk,
        {.skip = {done_.begin(), done_.end()}, .ramp_s = 0.01, .between_runs = between_runs_});
    link.pass_rest();
    // What a sensor does not show, nobody can prevent.
    const bool blind = misfortune.has(Trouble::stage_fault) &&
                       fault_traits(misfortune.fault.kind).target == FaultTarget::sensor;
    if (!blind && testimony_.excursion > kFarthest)
      blame(fmt::format("the stage is at {:.3g} hard windows", testimony_.excursion));
    if (testimony_.running) blame("the stage is not at rest");
    for (const std::string& broken : testimony_.broken) blame(broken);
    ++report_.ends[result.end];
    report_.cycles += result.health.cycles;
    judge_end(result, misfortune);
    for (WitnessedRun& run : testimony_.runs) witnessed_.emplace(run.seed, std::move(run));
    const bool killed = misfortune.has(Trouble::killed) || result.log_failed;
    if (!killed) log->close(0, result.message.c_str());
    const std::uint64_t bytes = log->bytes();
    log.reset();
    check_log(logged_runs_, false);
    const std::size_t before = done_.size();
    done_ = complete_runs();
    if (done_.size() != before + static_cast<std::size_t>(result.runs_done))
      blame(fmt::format("{} complete runs were reported, the log has {} more", result.runs_done,
                        static_cast<int>(done_.size()) - static_cast<int>(before)));
    if (killed) die(disk, bytes, before, result.runs_done, random);
  }

  /// The process ends when part of the `bytes` of the log was written, or after it has reported `runs_done`.
  void die(const DiskLog& disk, std::uint64_t bytes, std::size_t before, int runs_done,
           RandomNumbers& random) {
    const bool at_end = random.uniform() < 0.5;
    const auto part = at_end ? 0.0 : random.uniform();
    const auto written =
        bytes - static_cast<std::uint64_t>(part * static_cast<double>(bytes - disk.bytes_before()));
    const DiskLog::Synchronized medium = disk.before(written);
    tear(medium.bytes, written, random);
    done_ = complete_runs();
    const int certain = at_end ? runs_done : medium.complete_runs;
    if (done_.size() < before + static_cast<std::size_t>(certain)) blame("a complete run is lost");
  }

  /// As `stageid run --resume` does, or after `stageid log recover`.
  SlogWriter open(const LogInfo& info) {
    if (std::filesystem::exists(file_) && is_unwritten_slog(file_)) std::filesystem::remove(file_);
    if (!std::filesystem::exists(file_)) return SlogWriter::create(file_, info);
    const auto resume = [&] {
      SlogWriter log = SlogWriter::resume(file_, info);
      check_log(0, true);
      logged_runs_ = SlogReader(file_, false).runs().size();
      if (complete_runs() != done_) blame("the resumed log has other complete runs");
      return log;
    };
    try {
      return resume();
    } catch (const FormatError&) {
      const auto recovered = directory_ / fmt::format("{}.slog", ++recoveries_);
      recover_log(file_, recovered);
      file_ = recovered;
    }
    return resume();
  }

  std::set<RunId> complete_runs() const {
    const std::vector<RunId> runs = runs_without_loss(SlogReader(file_, false));
    return {runs.begin(), runs.end()};
  }

  void judge_end(const ExperimentResult& result, const Misfortune& misfortune) {
    using enum Trouble;
    bool plausible = true;
    switch (result.end) {
      case ExperimentEnd::complete:
        plausible =
            done_.size() + static_cast<std::size_t>(result.runs_done) == plan_.runs().size() &&
            !must_stop(misfortune);
        break;
      case ExperimentEnd::interrupted:
        plausible = misfortune.has_any({interrupted});
        break;
      case ExperimentEnd::log_failed:
        plausible = misfortune.has_any({disk});
        break;
      case ExperimentEnd::limit:
        plausible = misfortune.has_any({stage_fault, loud, wire, cut, bus});
        break;
      case ExperimentEnd::fault:
        plausible = misfortune.has_any({stage_fault, loud, wire, cut, bus, interlock, tripped});
        break;
    }
    if (!plausible)
      blame(fmt::format("ended with {} ({})", static_cast<int>(result.end), result.message));
    if (result.message.empty()) blame("ended without a message");
  }

  /// Whether something happened within the samples of a run that no run survives.
  bool must_stop(const Misfortune& misfortune) const {
    using enum Trouble;
    using Kind = SimulationSpec::Fault::Kind;
    const auto samples = static_cast<std::uint64_t>(plan_.samples_per_run());
    const SimulationSpec::Fault& fault = misfortune.fault;
    const bool fatal = misfortune.has(stage_fault) &&
                       (fault.kind == Kind::interlock || fault.kind == Kind::nan_sensor ||
                        fault.kind == Kind::dead_sensor);
    const auto run = static_cast<std::size_t>(fault.run);
    constexpr std::uint64_t kNoticed = 20;  // cycles later at the latest
    if (fatal && run < testimony_.runs.size() && fault.from_cycle + kNoticed < samples) return true;
    std::uint64_t first = 0;
    for (const WitnessedRun& witnessed : testimony_.runs) {
      const std::uint64_t end = first + witnessed.u.size();
      if (misfortune.at >= first && misfortune.at < end)
        return link_ != Link::resident && misfortune.at - first + kNoticed < samples &&
               misfortune.has_any({interrupted, tripped, cut, bus, interlock});
      first = end;
    }
    return false;
  }

  /// Compares the runs from this one on with what the stage did. `damaged`: rows may be lost, and are marked.
  void check_log(std::size_t run, bool damaged) {
    const SlogReader reader(file_, false);
    if (!damaged && !reader.damage().empty()) blame("the log is damaged");
    for (; run < reader.runs().size(); ++run) {
      const LogRun& logged = reader.runs()[run];
      const RunId id{logged.realization, logged.experiment};
      if (damaged && id.realization < 0) continue;  // its beginning is lost
      LogSamples samples;
      reader.read(run, 0, logged.samples, samples);
      const auto marked = static_cast<std::uint64_t>((samples.marked != 0).count());
      if (logged.complete && marked != logged.health.marked)
        blame(fmt::format("{} samples are marked, the end of the run says {}", marked,
                          logged.health.marked));
      if (logged.complete && logged.samples != static_cast<std::uint64_t>(plan_.samples_per_run()))
        blame("a complete run is too short or too long");
      if (!damaged && reader.excitation(run) != plan_.excitation(id))
        blame("the log has another excitation");
      // A held stage is started for the first run only.
      const auto [first, last] = between_runs_ == BetweenRuns::hold
                                     ? std::pair(witnessed_.begin(), witnessed_.end())
                                     : witnessed_.equal_range(run_seed(plan_.spec().seed, id));
      if (logged.samples > 0 && std::none_of(first, last, [&](const auto& witnessed) {
            return is_record_of(samples, witnessed.second, damaged);
          }))
        blame(fmt::format("run {}.{} is not what the stage did", id.realization, id.experiment));
    }
  }

  /// Over a bus, numbers are counts.
  bool same(const std::vector<double>& a, const Eigen::RowVectorXd& b,
            const std::vector<double>& range) const {
    for (std::size_t i = 0; i < a.size(); ++i)
      if (!(std::abs(a[i] - b[static_cast<Eigen::Index>(i)]) <=
            (link_ == Link::direct ? 0.0 : range[i] / kCounts)))
        return false;
    return true;
  }

  /// Whether the good samples are exchanges of the stage, and without a wire the bad ones too, but for those that are
  /// lost. Exchanges are left out before the first sample if the stage was held, and over a wire where samples are bad.
  bool is_record_of(const LogSamples& samples, const WitnessedRun& run, bool damaged) const {
    const bool over_can = link_ != Link::direct;
    std::size_t exchange = 0;
    bool may_skip = over_can || between_runs_ == BetweenRuns::hold;
    for (Eigen::Index row = 0; row < samples.actuators.rows(); ++row) {
      const bool good = samples.marked[row] == 0;
      const auto fits = [&](std::size_t n) {
        return n < run.u.size() &&
               same(run.u[n], samples.actuators.row(row), bus_.actuator_range_n) &&
               (!good || same(run.y[n], samples.sensors.row(row), bus_.sensor_range_m));
      };
      while (good && may_skip && exchange < run.u.size() && !fits(exchange)) ++exchange;
      if ((good || !(over_can || damaged || may_skip)) && !fits(exchange)) return false;
      if (good || !(over_can || may_skip)) ++exchange;
      may_skip = !good && (over_can || may_skip);
    }
    return true;
  }

  /// Cuts the log. Of what was written and not synchronized, any part is on the disk.
  void tear(std::uint64_t synchronized, std::uint64_t written, RandomNumbers& random) {
    std::filesystem::resize_file(file_, written);
    if (random.uniform() < 0.5) return;  // the system went on
    std::fstream stream(file_, std::ios::binary | std::ios::in | std::ios::out);
    const std::string zeros(512, '\0');
    for (std::uint64_t at = (synchronized + 511) / 512 * 512; at + 512 <= written; at += 512) {
      if (random.uniform() < 0.8) continue;
      stream.seekp(static_cast<std::streamoff>(at));
      stream.write(zeros.data(), static_cast<std::streamsize>(zeros.size()));
    }
  }

  void blame(const std::string& what) {
    report_.broken.push_back(fmt::format("experiment {}, attempt {}: {} (of: {})",
                                         report_.experiments, report_.attempts, what, misfortune_));
  }

  RandomNumbers& random_;
  Link link_;
  BetweenRuns between_runs_;
  SimulatedSpec stage_;
  CanSpec bus_ = day_bus(stage_);
  ExperimentPlan plan_;
  std::filesystem::path directory_;
  std::filesystem::path file_;
  DayReport& report_;
  Testimony testimony_;
  std::string misfortune_;  // of the last attempt
  std::set<RunId> done_;
  std::size_t logged_runs_ = 0;
  int recoveries_ = 0;
  std::multimap<std::uint64_t, WitnessedRun> witnessed_;  // by seed, of all attempts
};

}  // namespace

DayReport simulate_day(std::uint64_t seed, std::uint64_t day) {
  constexpr int kExperiments = 24;  // one per hour
  RandomNumbers random(splitmix64(splitmix64(seed) + day));
  DayReport report;
  while (report.experiments < kExperiments) {
    const TemporaryDirectory directory;
    ++report.experiments;
    DayExperiment(random, directory / "", report).perform();
  }
  return report;
}

}  // namespace stageid::test
