#include "excitation/plan/limited_design.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "excitation/multisine/multisine_lines.hpp"
#include "excitation/plan/joint_crest_reduction.hpp"
#include "excitation/plan/least_variance_power.hpp"
#include "excitation/threads/worker_pool.hpp"
#include "excitation/words/require.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Spectrum and crest factors depend on each other; after three rounds the scale changes by less than 1 %.
constexpr int kTurns = 3;
constexpr int kLastTurns = 2;  // with the phases of all realizations
constexpr double kFirstCrestFactor = 2.5;
constexpr double kEnough = 0.93;  // below 1, because the peaks between the samples must fit too

void check(const FrequencyGrid& grid, const LimitedDesignSpec& spec) {
  const auto axes = std::ssize(spec.experiment.axes);
  require(spec.cost.rows() == axes && spec.cost.cols() == grid.size(),
          "limited design: cost is {} x {}; expected {} axes x {} lines", spec.cost.rows(),
          spec.cost.cols(), axes, grid.size());
  require(spec.safety > 0.0 && spec.safety <= 1.0,
          "limited design: safety is {}; it must be in (0, 1]", spec.safety);
  require(spec.experiment.crest_iterations >= 1,
          "limited design: crest_iterations must be 1 or more, because the design includes the "
          "phases");
  for (const BoundedSignal& s : spec.signals) {
    require(s.transfer.rows() == axes && s.transfer.cols() == grid.size() && s.transfer.allFinite(),
            "limited design: {}: transfer must be {} axes x {} lines and finite", s.name, axes,
            grid.size());
    require(s.peak_limit > 0.0 && s.rms_limit > 0.0 && s.reserve >= 0.0,
            "limited design: {}: limits must be positive and the reserve nonnegative", s.name);
    require(s.reserve < spec.safety * s.peak_limit,
            "limited design: {}: the reserve {:.4g} uses up the limit {:.4g}; lower the reserve or "
            "raise the limit",
            s.name, s.reserve, s.peak_limit);
  }
}

/// Axes of a group are excited in the same runs: one group per axis, or one group of all axes.
std::vector<std::vector<Index>> groups_of(const ExperimentPlan& plan) {
  const auto axes = plan.spec().axes.size();
  const bool single = plan.spec().scheme == ExcitationScheme::single_axis;
  std::vector<std::vector<Index>> groups(single ? axes : 1);
  for (std::size_t p = 0; p < axes; ++p) groups[single ? p : 0].push_back(static_cast<Index>(p));
  return groups;
}

class Designer {
 public:
  Designer(const FrequencyGrid& grid, const LimitedDesignSpec& spec)
      : grid_(grid), spec_(spec), plan_(flat_plan(grid, spec)), groups_(groups_of(plan_)) {
    cost_ = (plan_.amplitude().array() > 0.0).select(spec.cost, 0.0);
    const Eigen::VectorXd frequency_hz = grid.frequency_hz();
    for (const BoundedSignal& s : spec.signals) {
      gain_.emplace_back(s.transfer.cwiseAbs2() / 2.0);
      for (Index k = 0; k < grid.size(); ++k)
        gain_.back().col(k) *=
            std::norm(kind_factor(s.kind, frequency_hz[k], grid.sample_rate_hz()));
    }
    crest_.setConstant(std::ssize(spec.signals), std::ssize(groups_), kFirstCrestFactor);
  }

  LimitedDesign design() {
    std::vector<MatrixXd> phases(spec_.experiment.realizations);
    for (int m = 0; m < spec_.experiment.realizations; ++m) phases[m] = plan_.phase_rad(m);
    for (int turn = 0; turn < kTurns; ++turn) {
      set_amplitude();
      phases.front() = reduced(phases.front());
      take_crest_factors(predicted(phases.front()));
    }
    set_amplitude();
    for_each_task(0, static_cast<int>(phases.size()),
                  [&](int m) { phases[m] = reduced(phases[m]); });
    // Each signal has a worst realization. Limiting that signal alone costs less variance than scaling all.
    for (int turn = 0; turn < kLastTurns; ++turn) {
      take_crest_factors(predicted_all(phases));
      set_amplitude();
    }
    return finish(predicted_all(phases), phases);
  }

 private:
  using Peaks = std::vector<std::vector<SignalPeak>>;  // group, signal

  static ExperimentPlan flat_plan(const FrequencyGrid& grid, const LimitedDesignSpec& spec) {
    ExperimentSpec flat = spec.experiment;
    flat.crest_iterations = 0;  // the start has the plan's own random phases
    flat.scaling = AmplitudeScaling::rms;
    for (ExcitationAxis& axis : flat.axes) {
      axis.level = 1.0;
      axis.shape = {};
    }
    return {grid, flat};
  }

  /// Mean square of signal s, on the lines of a group.
  double mean_square(std::size_t s, const std::vector<Index>& group) const {
    double sum = 0.0;
    for (const Index p : group) sum += gain_[s].row(p).dot(amplitude_.row(p).cwiseAbs2());
    return sum;
  }

  /// Largest mean square of a signal that its limits allow.
  double allowed(std::size_t s, Index group) const {
    const BoundedSignal& signal = spec_.signals[s];
    const double peak =
        (spec_.safety * signal.peak_limit - signal.reserve) / crest_(static_cast<Index>(s), group);
    return std::pow(std::min(peak, spec_.safety * signal.rms_limit), 2);
  }

  void set_amplitude() {
    amplitude_.resize(spec_.cost.rows(), spec_.cost.cols());
    const Index lines = grid_.size();
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const std::vector<Index>& group = groups_[g];
      const auto size = std::ssize(group);
      MatrixXd bounds(std::ssize(spec_.signals), size * lines);
      Eigen::VectorXd cost(size * lines);
      for (Index i = 0; i < size; ++i) {
        const Index p = group[i];
        cost.segment(i * lines, lines) = cost_.row(p).transpose();
        for (std::size_t s = 0; s < spec_.signals.size(); ++s)
          bounds.block(static_cast<Index>(s), i * lines, 1, lines) =
              gain_[s].row(p) / allowed(s, static_cast<Index>(g));
      }
      const Eigen::VectorXd power = least_variance_power(cost, bounds).power;
      for (Index i = 0; i < size; ++i)
        amplitude_.row(group[i]) = power.segment(i * lines, lines).cwiseSqrt().transpose();
    }
    amplitude_ = (plan_.amplitude().array() > 0.0).select(amplitude_, 0.0).eval();
  }

  MatrixXd reduced(const MatrixXd& phase_rad) const {
    JointCrestProblem problem{grid_, plan_.mixing(), spec_.signals, amplitude_};
    // If rms limits bound the amplitudes, peaks need not fall far below `safety` of their limits.
    problem.enough = kEnough * spec_.safety;
    return reduce_joint_crest(problem, phase_rad, spec_.experiment.crest_iterations);
  }

  Peaks predicted(const MatrixXd& phase_rad) const {
    Peaks peaks(groups_.size(), std::vector<SignalPeak>(spec_.signals.size()));
    SignalPredictor predictor(grid_);
    for (int e = 0; e < plan_.experiments(); ++e) {
      const Eigen::MatrixXcd R = axis_coefficients(plan_.mixing().col(e), amplitude_, phase_rad);
      const std::size_t group = groups_.size() == 1 ? 0 : static_cast<std::size_t>(e);
      const std::vector<SignalPeak> run = predictor.predict(spec_.signals, R);
      for (std::size_t s = 0; s < run.size(); ++s) peaks[group][s].include(run[s]);
    }
    return peaks;
  }

  Peaks predicted_all(const std::vector<MatrixXd>& phases) const {
    std::vector<Peaks> peaks(phases.size());
    for_each_task(0, static_cast<int>(phases.size()),
                  [&](int m) { peaks[m] = predicted(phases[m]); });
    Peaks& all = peaks.front();
    for (const Peaks& more : peaks)
      for (std::size_t g = 0; g < all.size(); ++g)
        for (std::size_t s = 0; s < all[g].size(); ++s) all[g][s].include(more[g][s]);
    return std::move(all);
  }

  void take_crest_factors(const Peaks& peaks) {
    for (std::size_t g = 0; g < peaks.size(); ++g)
      for (std::size_t s = 0; s < peaks[g].size(); ++s)
        crest_(static_cast<Index>(s), static_cast<Index>(g)) =
            std::max(1.0, peaks[g][s].peak() / std::sqrt(mean_square(s, groups_[g])));
  }

  /// Largest factor for the group's amplitudes that satisfies all limits.
  double scale_of(const std::vector<SignalPeak>& peaks) const {
    double scale = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < peaks.size(); ++s) {
      const BoundedSignal& signal = spec_.signals[s];
      scale =
          std::min(scale, (spec_.safety * signal.peak_limit - signal.reserve) / peaks[s].peak());
      scale = std::min(scale, spec_.safety * signal.rms_limit / peaks[s].rms);
    }
    return scale;
  }

  LimitedDesign finish(const Peaks& peaks, const std::vector<MatrixXd>& phases) {
    std::vector<SignalPeak> largest(spec_.signals.size());
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const double scale = scale_of(peaks[g]);
      for (const Index p : groups_[g]) amplitude_.row(p) *= scale;
      for (std::size_t s = 0; s < largest.size(); ++s) {
        const SignalPeak& peak = peaks[g][s];
        largest[s].include({scale * peak.steady, scale * peak.from_rest, scale * peak.rms});
      }
    }
    ExperimentSpec experiment = spec_.experiment;
    experiment.scaling = AmplitudeScaling::rms;
    for (std::size_t p = 0; p < experiment.axes.size(); ++p) {
      const Eigen::VectorXd A = amplitude_.row(p).transpose();
      experiment.axes[p].shape = A;
      experiment.axes[p].level = A.norm() / std::sqrt(2.0);
    }
    const double cost =
        (cost_.array() > 0.0).select(cost_.array() / amplitude_.array().square(), 0.0).sum();
    return {ExperimentPlan(grid_, std::move(experiment), phases), std::move(largest), cost};
  }

  const FrequencyGrid& grid_;
  const LimitedDesignSpec& spec_;
  ExperimentPlan plan_;
  std::vector<std::vector<Index>> groups_;
  std::vector<MatrixXd> gain_;  // a signal's mean square per mean square of one line of one axis
  MatrixXd crest_;              // signals x groups
  MatrixXd cost_;               // spec_.cost on the lines of each axis
  MatrixXd amplitude_;
};

}  // namespace

LimitedDesign design_within_limits(const FrequencyGrid& grid, const LimitedDesignSpec& spec) {
  check(grid, spec);
  return Designer(grid, spec).design();
}

double limit_use(const BoundedSignal& signal, const SignalPeak& peak) {
  return std::max((peak.peak() + signal.reserve) / signal.peak_limit, peak.rms / signal.rms_limit);
}

}  // namespace stageid
