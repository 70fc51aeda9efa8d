#include "frf/plant/plant_frf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_error.hpp"
#include "excitation/threads/parcel.hpp"
#include "excitation/threads/team.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "frf/plant/detection_average.hpp"
#include "frf/plant/frf_provenance.hpp"
#include "frf/plant/line_alignment.hpp"
#include "frf/plant/plant_average.hpp"
#include "frf/plant/step_search.hpp"
#include "frf/plant/zippered_fit.hpp"
#include "frf/response/channel_positions.hpp"
#include "frf/response/covariance_smoothing.hpp"
#include "frf/response/leaked_noise.hpp"
#include "frf/runs/byte_counter.hpp"
#include "frf/runs/channel_choice.hpp"
#include "frf/runs/excitation_spectrum.hpp"
#include "frf/runs/health_gathering.hpp"
#include "frf/runs/realization_spectra.hpp"
#include "frf/runs/record_spectra.hpp"
#include "frf/runs/run_spectra.hpp"
#include "frf/runs/run_steps.hpp"
#include "frf/runs/run_table.hpp"

namespace stageid {
namespace {

constexpr double kClearlyLess = 0.8;  // of the total variance
constexpr double kRounding = 1e-30;   // of a ratio of variances

/// Lines and axes, which the first realization determines for all.
struct ExcitedPart {
  std::vector<int> lines;
  std::vector<Eigen::Index> axes;
  bool single_axis = true;           ///< in every run
  std::vector<Eigen::Index> only{};  ///< zippered: the channel of each line; otherwise empty
};

std::size_t most_runs(const std::vector<RealizationRuns>& realizations) {
  return std::ranges::max_element(realizations, {},
                                  [](const RealizationRuns& one) { return one.runs.size(); })
      ->runs.size();
}

/// An estimate in progress: reads realization by realization, with threads over its runs.
class PlantEstimation {
 public:
  PlantEstimation(ChosenRuns chosen, const FrfOptions& options)
      : realizations_(std::move(chosen.realizations)),
        incomplete_(std::move(chosen.incomplete)),
        options_(options),
        team_(options.team != nullptr ? *options.team : Team::one()),
        info_(realizations_.front().runs.front().log->info()),
        workers_(worker_count(options.threads)),
        run_workers_(options.threads, most_runs(realizations_), info_.period_samples),
        bytes_(options_, realizations_) {}

  /// `health`: receives the same data; may be null.
  FrfEstimate estimate(HealthGathering* health) {
    for (std::size_t m = 0; m < realizations_.size(); ++m) {
      const RealizationRuns& realization = realizations_[m];
      const std::vector<RunExcitation> excitation =
          run_workers_.read_excitation(realization.runs, true);
      if (!average_) prepare(realization, excitation);
      check_excitation(realization, excitation);
      if (!zippered_ && realization.runs.size() < excited_.axes.size())
        fail_request("{} but only {} in realization {} (counted from 1); exclude this realization",
                     counted(excited_.axes.size(), "excited axis", "excited axes"),
                     counted(realization.runs.size(), "experiment"), realization.realization + 1);
      if (health != nullptr) health->excite(m, excitation);
      std::vector<Eigen::MatrixXcd> R;
      for (const RunExcitation& run : excitation)
        R.push_back(run.spectrum.values(excited_.axes, Eigen::all));
      RealizationSpectra spectra(realization.realization, std::move(R), run_workers_.pool());
      measure(m, excitation, health, spectra);
      note_spoilt(spectra);
      if (leave_out(realization, spectra)) continue;
      refuse_constant_inputs(realization, spectra, channels_);
      note_quality(realization, spectra);
      include(spectra, excitation);
    }
    if (left_out_.size() == realizations_.size()) refuse_marked_runs(*first_marked_);
    FrfEstimate frf = describe();
    average_->finish(frf, workers_);
    const RealizationScatter scatter = average_->scatter();
    if (options_.method == FrfMethod::periodic) lower_leaked_noise(scatter, frf);
    if (health != nullptr) note_change(frf, *health);
    if (detection_) frf.detection = detection_->finish(info_.sample_rate_hz / info_.period_samples);
    // Outside these lines, the response to some axis would be extrapolated.
    if (zippered_) {
      const double low_hz = frf.frequency_hz[zippered_->lines().first()];
      const double high_hz = frf.frequency_hz[zippered_->lines().last()];
      frf = select_band(std::move(frf), low_hz, high_hz);
    }
    if (alignment_ && why_linearity_cannot_be_tested(frf).empty())
      frf.nonlinearity = nonlinearity_test(
          frf, {scatter, alignment_->of_residuals(info_.sample_rate_hz / info_.period_samples)});
    frf.provenance_json = provenance_->json();
    if (options_.covariance_lines != 1) frf = smooth_covariance(frf, options_.covariance_lines);
    const std::vector<std::string> outputs = frf.outputs.names;
    return select_channels(std::move(frf), channels_.inputs, outputs);
  }

  const std::vector<RealizationRuns>& realizations() const noexcept { return realizations_; }

 private:
  /// Index of an excited channel in the list of axes.
  Eigen::Index axis_of(Eigen::Index channel) const {
    return std::ranges::lower_bound(excited_.axes, channel) - excited_.axes.begin();
  }

  ExcitedPart excited_part(const RealizationRuns& realization,
                           const std::vector<RunExcitation>& excitation) const {
    ExcitedPart part{excitation.front().spectrum.lines, {}};
    if (part.lines.empty())
      fail_request("{}/excitation: nothing is excited; record the signal that is added in the loop",
                   realization.runs.front().place());
    part.axes = excited_axes(excitation);
    part.single_axis = std::ranges::all_of(
        excitation, [](const RunExcitation& run) { return run.spectrum.channels.size() == 1; });
    const ExcitationSpectrum& first = excitation.front().spectrum;
    if (excitation.size() == 1 && first.is_zippered()) part.only = first.only;
    return part;
  }

  void check_excitation(const RealizationRuns& realization,
                        const std::vector<RunExcitation>& excitation) const {
    const std::string first = realizations_.front().runs.front().place();
    for (std::size_t e = 0; e < excitation.size(); ++e) {
      const ExcitationSpectrum& spectrum = excitation[e].spectrum;
      const std::string place = realization.runs[e].place() + "/excitation";
      if (spectrum.lines.empty())
        fail_request(
            "{}: nothing is excited in this run, but {} lines are in {}. Exclude its "
            "axis (--inputs with the other axes), or measure the run again",
            place, excited_.lines.size(), first);
      if (spectrum.lines != excited_.lines) {
        std::vector<int> differing;
        std::ranges::set_symmetric_difference(spectrum.lines, excited_.lines,
                                              std::back_inserter(differing));
        const double resolution_hz = info_.sample_rate_hz / info_.period_samples;
        fail_request(
            "{}: {} lines are excited here and {} in {}; line {} ({} Hz) is in only one "
            "of them. All runs must excite the same lines",
            place, spectrum.lines.size(), excited_.lines.size(), first, differing.front(),
            differing.front() * resolution_hz);
      }
      if (!excited_.only.empty() && spectrum.only != excited_.only)
        fail_request(
            "{}: the axes have different lines than in {}; in a zippered experiment an "
            "axis must have the same lines in all realizations",
            place, first);
      for (const Eigen::Index axis : spectrum.channels) {
        if (std::ranges::binary_search(excited_.axes, axis)) continue;
        fail_request(
            "{}: channel {} is excited here but not in realization {} (counted from 1); "
            "all realizations must excite the same axes",
            place, info_.excitation.name(axis), realizations_.front().realization + 1);
      }
    }
  }

  void measure(std::size_t m, const std::vector<RunExcitation>& excitation, HealthGathering* health,
               RealizationSpectra& spectra) {
    const RealizationRuns& realization = realizations_[m];
    const auto count = std::ssize(realization.runs);
    std::vector<RunSpectra> runs(realization.runs.size());
    const TileShare own = team_.share(count);
    run_workers_.for_each(
        static_cast<std::size_t>(own.count), [&](RunWorkspace& workspace, std::size_t i) {
          const std::size_t e = static_cast<std::size_t>(own.first) + i;
          const auto read_done = [this](double bytes) { bytes_.add(bytes); };
          HealthPart* part = health != nullptr ? &health->part(m, e) : nullptr;
          RunSpectra run =
              options_.method == FrfMethod::lpm
                  ? measure_record(realization.runs[e], excitation[e], channels_, options_.periods,
                                   workspace, part, read_done)
                  : measure_run(realization.runs[e], lines_, channels_, excitation[e].period,
                                options_.periods, workspace, part, read_done);
          if (part != nullptr) part->forget_deviating(run);
          runs[e] = std::move(run);
        });
    if (team_.divides(count)) exchange(m, health, runs);
    for (std::size_t e = 0; e < runs.size(); ++e) spectra.add(e, std::move(runs[e]));
  }

  /// Gives the runs of each process to all others.
  void exchange(std::size_t m, HealthGathering* health, std::vector<RunSpectra>& runs) {
    for (int owner = 0; owner < team_.size(); ++owner) {
      const TileShare of_owner = team_.share(std::ssize(runs), owner);
      for (Eigen::Index i = 0; i < of_owner.count; ++i) {
        const auto e = static_cast<std::size_t>(of_owner.first + i);
        if (owner != team_.rank()) {
          runs[e].scatter_re = run_workers_.pool().take();
          runs[e].scatter_im = run_workers_.pool().take();
          bytes_.add(ByteCounter::bytes_of(realizations_[m].runs[e]));
        }
        broadcast(team_, owner, runs[e]);
        if (health != nullptr) broadcast(team_, owner, health->part(m, e));
      }
    }
  }

  void prepare(const RealizationRuns& realization, const std::vector<RunExcitation>& excitation) {
    excited_ = excited_part(realization, excitation);
    const bool zippered = !excited_.only.empty();
    channels_ = choose_channels(info_, excited_.axes,
                                zippered ? excited_.axes.size() : realization.runs.size(),
                                realization.realization, options_);
    const auto outputs = std::ssize(channels_.outputs);
    average_ = std::make_unique<PlantAverage>(frequencies_hz(info_, excited_.lines), excited_.lines,
                                              outputs, std::ssize(channels_.estimated),
                                              options_.covariance);
    provenance_ = std::make_unique<FrfProvenance>(info_, options_, channels_);
    excluded_power_.setZero(std::ssize(channels_.excluded));
    lines_ = {excited_.lines, excited_.lines.size()};
    const std::vector<std::string> axes = pick(info_.excitation, excited_.axes).names;
    if (zippered) {
      ZipperedLines lines{excited_.lines, {}, std::ssize(axes)};
      for (const Eigen::Index channel : excited_.only) lines.axis.push_back(axis_of(channel));
      require_enough_lines(lines, axes, realization.runs.front().place() + "/excitation");
      zippered_ = std::make_unique<ZipperedFit>(std::move(lines), outputs);
    }
    if (options_.method == FrfMethod::lpm) return;
    const std::vector<int> detection = detection_lines(excited_.lines);
    lines_.lines.insert(lines_.lines.end(), detection.begin(), detection.end());
    detection_ =
        std::make_unique<DetectionAverage>(excited_.lines, axes, excited_.single_axis, outputs);
    if (!zippered)
      alignment_ = std::make_unique<AlignmentAverage>(excited_.lines, detection, outputs);
  }

  void note_spoilt(const RealizationSpectra& spectra) {
    for (const RunSpectra& run : spectra.runs()) {
      dropped_.insert(dropped_.end(), run.dropped.begin(), run.dropped.end());
      replaced_.insert(replaced_.end(), run.replaced.begin(), run.replaced.end());
    }
  }

  /// Whether a run has no clean period; records it and the realization is skipped.
  bool leave_out(const RealizationRuns& realization, const RealizationSpectra& spectra) {
    for (std::size_t e = 0; e < realization.runs.size(); ++e) {
      if (spectra.runs()[e].periods > 0) continue;
      left_out_.push_back(
          {realization.realization, fmt::format("{}: {}", realization.runs[e].place(),
                                                no_clean_period(realization.runs[e]))});
      if (first_marked_ == nullptr) first_marked_ = &realization.runs[e];
      return true;
    }
    return false;
  }

  void note_quality(const RealizationRuns& realization, const RealizationSpectra& spectra) {
    const auto inputs = std::ssize(channels_.estimated);
    for (std::size_t e = 0; e < realization.runs.size(); ++e) {
      const RunSpectra& run = spectra.runs()[e];
      provenance_->add(realization.runs[e], run.fingerprint);
      fewest_periods_ = std::min(fewest_periods_, run.periods);
      for (Eigen::Index k = 0; k < std::ssize(excited_.lines); ++k) {
        for (Eigen::Index i = run.mean.rows() - inputs; i < run.mean.rows(); ++i) {
          input_power_ += std::norm(run.mean(i, k));
        }
      }
      excluded_power_ += run.excluded_power;
    }
  }

  void include(const RealizationSpectra& spectra, const std::vector<RunExcitation>& excitation) {
    const Eigen::MatrixXcd G_before = alignment_ ? average_->mean_response() : Eigen::MatrixXcd();
    average_->add(spectra, workers_, zippered_.get());
    if (!detection_) return;
    if (alignment_) alignment_->add(spectra, G_before, average_->mean_response(), workers_);
    std::vector<Eigen::Index> axis;
    for (const RunExcitation& run : excitation)
      axis.push_back(axis_of(run.spectrum.channels.front()));
    detection_->add(spectra, average_->mean_response(), axis, workers_);
  }

  FrfEstimate describe() const {
    FrfEstimate frf;
    frf.outputs = pick(info_.sensors, channels_.outputs);
    frf.inputs = pick(info_.actuators, channels_.estimated);
    frf.excluded_channels = pick(info_.actuators, channels_.excluded).names;
    frf.excluded_power = excluded_power_ / input_power_;
    frf.sample_rate_hz = info_.sample_rate_hz;
    frf.hold = Hold::zoh;
    frf.method = options_.method;
    frf.dropped_periods = dropped_;
    frf.replaced_samples = replaced_;
    std::ranges::merge(incomplete_, left_out_, std::back_inserter(frf.left_out_realizations), {},
                       &LeftOutRealization::realization, &LeftOutRealization::realization);
    frf.periods = fewest_periods_;
    frf.experiments = static_cast<int>(realizations_.front().runs.size());
    return frf;
  }

  /// Records drift and noise differences, which only the finished response shows.
  void note_change(const FrfEstimate& frf, HealthGathering& health) const {
    EstimateResults results;
    for (const OddRun& odd : average_->odd_runs()) {
      const auto of =
          std::ranges::find(realizations_, odd.realization, &RealizationRuns::realization);
      results.noisy_runs.push_back({odd.realization, of->runs[odd.experiment].run().experiment,
                                    frf.outputs.name(odd.output), odd.ratio});
    }
    const UsedRun& run = realizations_.front().runs.front();
    results.differences = average_->differences(frf);
    // A channel that one realization records differently has a slope over the realizations, and is smooth, too.
    if (results.differences.changes.empty()) {
      results.drift = average_->drift(frf, run.transient_periods + run.periods);
      // One realization that differs from several others is no drift. Of two, neither is the odd one.
      const std::vector<int> odd =
          frf.realizations > 2 ? results.differences.outlying : std::vector<int>{};
      std::optional<PlantChange>& change = results.differences.plant;
      if (alignment_ && (!results.drift || !odd.empty()))
        change = find_plant_change(frf, alignment_->cosine_of_responses());
      if (change) {
        change->realizations = odd;
        results.drift.reset();
      }
    }
    health.note(std::move(results));
  }

  std::vector<RealizationRuns> realizations_;
  std::vector<LeftOutRealization> incomplete_;
  const FrfOptions& options_;
  const Team& team_;
  const LogInfo& info_;
  int workers_;
  RunWorkers run_workers_;
  ByteCounter bytes_;
  ExcitedPart excited_;
  SpectrumLines lines_;
  ChannelChoice channels_;
  std::unique_ptr<ZipperedFit> zippered_;  // if one experiment is a whole realization
  std::unique_ptr<PlantAverage> average_;
  std::unique_ptr<DetectionAverage> detection_;
  std::unique_ptr<AlignmentAverage> alignment_;
  std::unique_ptr<FrfProvenance> provenance_;
  std::vector<DroppedPeriod> dropped_;
  std::vector<ReplacedSamples> replaced_;
  std::vector<LeftOutRealization> left_out_;
  const UsedRun* first_marked_ = nullptr;  // first run without a clean period
  int fewest_periods_ = std::numeric_limits<int>::max();
  double input_power_ = 0.0;
  Eigen::VectorXd excluded_power_;
};

/// The chosen runs, with what an earlier estimate has shown.
ChosenRuns runs_of(const std::vector<const LogReader*>& logs, const FrfOptions& options,
                   const EarlierEstimate& earlier) {
  ChosenRuns chosen = choose_runs(logs, options);
  if (earlier.steps.empty() && earlier.dropped.empty()) return chosen;
  for (RealizationRuns& realization : chosen.realizations)
    for (UsedRun& run : realization.runs) run.earlier = &earlier;
  return chosen;
}

/// One pass over the logs. Without `health_wanted`, the record is empty.
FrfAndHealth estimate_once(const std::vector<const LogReader*>& logs, FrfOptions options,
                           const EarlierEstimate& earlier, bool health_wanted) {
  if (!earlier.steps.empty()) options.periods = PeriodChoice::unmarked;  // steps look like outliers
  PlantEstimation estimation(runs_of(logs, options, earlier), options);
  std::optional<HealthGathering> health;
  if (health_wanted) health.emplace(estimation.realizations());
  FrfEstimate frf = estimation.estimate(health ? &*health : nullptr);
  return {std::move(frf), health ? health->finish() : HealthRecord{}};
}

/// Whether there is anything that steps could explain, or no test has looked for it.
bool is_suspicious(const FrfEstimate& frf) {
  const NonlinearityTest& test = frf.nonlinearity;
  if (test.band_hz.rows() == 0 || test.nonlinear() || frf.experiment_noise_ratio > 1.0) return true;
  for (Eigen::Index b = 0; b < test.band_hz.rows(); ++b)
    if (!test.settled(b)) return true;
  return false;
}

/// By how much the realizations scatter less, as they do if the steps are really there, or more: on average over lines
/// and channels.
double scatter_ratio(const FrfEstimate& with_steps, const FrfEstimate& without) {
  const Eigen::ArrayXXd ratio = with_steps.total_variance.array() / without.total_variance.array();
  return ratio.isFinite().all() ? std::exp(ratio.max(kRounding).log().mean()) : HUGE_VAL;
}

/// Moves limits, equal ones together, to where the realizations scatter least: the search finds them within a few
/// percent.
void refine_limits(const std::vector<const LogReader*>& logs, const FrfOptions& options,
                   EarlierEstimate& earlier, FrfEstimate& frf) {
  std::set<double> limits;
  for (const ActuatorStep& step : earlier.steps)
    if (step.rounding == Rounding::limited) limits.insert(step.step);
  for (double limit : limits)
    for (double part = 0.04; part > 5e-4; part *= 0.5)
      for (const double factor : {1.0 - part, 1.0 + part}) {
        EarlierEstimate next = earlier;
        for (ActuatorStep& step : next.steps)
          if (step.rounding == Rounding::limited && step.step == limit) step.step *= factor;
        FrfEstimate other = estimate_once(logs, options, next, false).frf;
        if (!(scatter_ratio(other, frf) < 1.0)) continue;
        earlier = std::move(next);
        frf = std::move(other);
        limit *= factor;
        break;
      }
}

/// The periods that were dropped, and those of which samples were replaced. Both are dropped if steps are undone.
std::vector<DroppedPeriod> spoilt_periods(const FrfEstimate& frf) {
  std::vector<DroppedPeriod> spoilt = frf.dropped_periods;
  for (const ReplacedSamples& one : frf.replaced_samples)
    spoilt.push_back({one.realization, one.experiment, one.period, one.reason});
  return spoilt;
}

/// The steps of the actuators, from all realizations. The response of a single one would contain most of their effect.
/// Each found step makes the others more visible. @param frf of the options' realizations
std::vector<ActuatorStep> steps_of(const std::vector<const LogReader*>& logs, FrfOptions options,
                                   FrfEstimate frf) {
  if (!options.realizations.empty()) {
    options.realizations.clear();
    frf = estimate_once(logs, options, {}, false).frf;
  }
  EarlierEstimate earlier{{}, spoilt_periods(frf)};
  while (frf.realizations > 1 && is_suspicious(frf)) {
    const std::vector<ActuatorStep> found =
        find_actuator_steps(runs_of(logs, options, earlier).realizations, frf, options);
    if (found.empty()) break;
    EarlierEstimate next = earlier;
    next.steps.insert(next.steps.end(), found.begin(), found.end());
    FrfEstimate better = estimate_once(logs, options, next, false).frf;
    if (!(scatter_ratio(better, frf) < kClearlyLess)) break;
    earlier = std::move(next);
    frf = std::move(better);
  }
  refine_limits(logs, options, earlier, frf);
  std::ranges::sort(earlier.steps, {}, &ActuatorStep::actuator);
  return earlier.steps;
}

/// Estimates from what the actuators applied.
FrfAndHealth estimate(const std::vector<const LogReader*>& logs, const FrfOptions& options,
                      bool health_wanted) {
  FrfAndHealth done = estimate_once(logs, options, {}, health_wanted);
  EarlierEstimate earlier{{}, spoilt_periods(done.frf)};
  try {
    earlier.steps = steps_of(logs, options, done.frf);
  } catch (const FormatError&) {
    // Realizations that were not asked for may be unusable.
  } catch (const std::invalid_argument&) {
  }
  if (earlier.steps.empty()) return done;
  FrfAndHealth again = estimate_once(logs, options, earlier, health_wanted);
  // The fingerprints are those of the logs, and so are the recorded signals.
  again.frf.provenance_json =
      with_steps(done.frf.provenance_json, earlier.steps, logs.front()->info().actuators);
  done.frf = std::move(again.frf);
  static_cast<EstimateResults&>(done.health) = std::move(again.health);
  done.health.steps = earlier.steps;
  return done;
}

}  // namespace

FrfEstimate estimate_plant_frf(const std::vector<const LogReader*>& logs,
                               const FrfOptions& options) {
  return estimate(logs, options, false).frf;
}

FrfAndHealth estimate_plant_frf_and_health(const std::vector<const LogReader*>& logs,
                                           const FrfOptions& options) {
  return estimate(logs, options, true);
}

}  // namespace stageid
