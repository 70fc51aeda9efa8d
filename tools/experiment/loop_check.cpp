#include "tools/experiment/loop_check.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>
#include <numbers>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "hal/simulator/loop_stability.hpp"
#include "tools/experiment/config_plan.hpp"
#include "tools/experiment/plant_prior_file.hpp"

namespace stageid {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::VectorXd;

constexpr double kPi = std::numbers::pi;
/// Modulus margin 1/3: a gain higher by a factor 1.5, or 19 degrees less phase, may make the loop unstable.
constexpr double kPoorSensitivity = 3.0;
/// Above this gain, a loop can still encircle the critical point.
constexpr double kNegligibleGain = 0.5;
/// Between two lines; the direction of a larger turn is ambiguous.
constexpr double kLargestTurn = 0.75 * kPi;

constexpr const char* kRemedy =
    "Lower crossover_hz, or correct the controller, the geometry or delay_s in the stage file";

std::string poor_margin(double sensitivity, double frequency_hz) {
  return fmt::format(
      "the loop has little margin: its sensitivity function reaches {:.2g} at {:.4g} Hz. Above {}, "
      "a gain {} times as large may make it unstable. Lower crossover_hz in the stage file",
      sensitivity, frequency_hz, kPoorSensitivity, kPoorSensitivity / (kPoorSensitivity - 1.0));
}

/// The loop gain of a prior, followed by rising frequency.
class PriorLoop {
 public:
  explicit PriorLoop(const ExperimentConfig& config) {
    const MotionController controller(config.stage.spec.controller);
    if (!controller.acts()) return;
    const VectorXd band_hz = outline_plan(config).grid().frequency_hz();
    const VectorXd below_hz = frequencies_below(band_hz[0], config.stage);
    const PlantPrior prior =
        read_plant_prior(config.limits->prior, config.stage.spec.info, band_hz, below_hz);
    for (std::size_t k = 0; k < prior.below_band.size(); ++k)
      follow(prior.below_band[k], controller, below_hz[k]);
    for (std::size_t k = 0; k < prior.response.size(); ++k)
      follow(prior.response[k], controller, band_hz[k]);
  }

  LoopCheck check() const {
    LoopCheck out;
    if (signs_ > 0 || (turns() > 0 && certain()))
      out.problem = fmt::format(
          "the controller does not stabilize the plant of the prior: {}. {}",
          signs_ > 0 ? fmt::format("{} of {} axes have the wrong sign", signs_, closed_)
                     : fmt::format("the loop gain encircles the critical point {} times", turns()),
          kRemedy);
    else if (!certain())
      out.doubt = fmt::format(
          "stability of the loop cannot be determined from the prior: {}. Measure a pilot on a "
          "wider band or with finer lines",
          last_gain_ > kNegligibleGain
              ? fmt::format("the loop gain at its last line, {:.4g} Hz, is still {:.2g}", last_hz_,
                            last_gain_)
              : fmt::format(
                    "the phase of the loop gain changes too much between two lines near {:.4g} Hz",
                    largest_turn_hz_));
    else if (sensitivity_ > kPoorSensitivity)
      out.doubt = poor_margin(sensitivity_, sensitivity_hz_);
    out.largest_sensitivity = sensitivity_;
    return out;
  }

 private:
  /// Frequencies starting where the loop gain is large and the plant is a free mass, above its suspension.
  static VectorXd frequencies_below(double lowest_hz, const StageConfig& stage) {
    double from_hz = lowest_hz;
    for (const AxisController& axis : stage.spec.controller.axes)
      if (axis.crossover_hz > 0.0) from_hz = std::min(from_hz, axis.crossover_hz);
    from_hz /= 30.0;  // without axes: the band includes the crossover
    if (stage.plant)
      for (const double suspension_hz : stage.plant->suspension_hz)
        from_hz = std::max(from_hz, 3.0 * suspension_hz);
    if (!(from_hz < lowest_hz)) return {};
    constexpr double kPerDecade = 100.0;
    const auto count = static_cast<Index>(std::ceil(kPerDecade * std::log10(lowest_hz / from_hz)));
    VectorXd out(count);
    for (Index i = 0; i < count; ++i)
      out[i] = from_hz *
               std::pow(lowest_hz / from_hz, static_cast<double>(i) / static_cast<double>(count));
    return out;
  }

  /// Accumulates the angle of det(I + L) from low to high frequencies. All poles of plant and controller must be
  /// inside the unit circle or at 1, where a free mass contributes -pi and the controller its own phase. The angle
  /// then ends at -pi per unstable pole of the closed loop (argument principle on the upper half of the unit circle).
  void follow(const MatrixXcd& plant, const MotionController& controller, double frequency_hz) {
    const MatrixXcd L = -plant * controller.response(frequency_hz);
    const std::complex<double> value =
        (MatrixXcd::Identity(L.rows(), L.rows()) + L).partialPivLu().determinant();
    if (last_hz_ == 0.0) {
      angle_ = start_angle(L, value);
    } else {
      const double turn = std::arg(value / last_);
      angle_ += turn;
      if (std::abs(turn) > largest_turn_) {
        largest_turn_ = std::abs(turn);
        largest_turn_hz_ = frequency_hz;
      }
    }
    last_ = value;
    last_hz_ = frequency_hz;
    last_gain_ = L.norm();
    const double size = largest_sensitivity(L);
    if (size > sensitivity_) {
      sensitivity_ = size;
      sensitivity_hz_ = frequency_hz;
    }
  }

  /// Where the loop gain is large, every closed axis is an eigenvalue of it: a free mass, which is negative above its
  /// suspension, times PI and lead, which are positive.
  double start_angle(const MatrixXcd& loop_gain, std::complex<double> value) {
    double expected = 0.0;
    for (const std::complex<double>& locus : eigenvalues(loop_gain)) {
      if (std::abs(locus) < kNegligibleGain) continue;
      ++closed_;
      if (locus.real() > 0.0) ++signs_;
      const double angle = std::arg(locus);
      expected += angle > 0.5 * kPi ? angle - 2.0 * kPi : angle;
    }
    return expected + std::remainder(std::arg(value) - expected, 2.0 * kPi);
  }

  int turns() const { return static_cast<int>(std::lround(std::abs(angle_) / (2.0 * kPi))); }
  bool certain() const { return last_gain_ <= kNegligibleGain && largest_turn_ <= kLargestTurn; }

  int closed_ = 0;
  int signs_ = 0;
  double angle_ = 0.0;
  double largest_turn_ = 0.0;
  double largest_turn_hz_ = 0.0;
  std::complex<double> last_ = 0.0;
  double last_hz_ = 0.0;
  double last_gain_ = 0.0;
  double sensitivity_ = 0.0;
  double sensitivity_hz_ = 0.0;
};

/// Why nothing is known about the loop of a stage file; empty if it can be tested.
std::string why_untested(const StageConfig& stage) {
  if (stage.spec.controller.by_peer)
    return "stability of the loop is not tested: the stage closes it by a controller of its own "
           "('controller: peer')";
  if (!stage.plant)
    return "stability of the loop is not tested: there is no 'plant'. Measure a pilot and design "
           "from it with 'level: {limits: {prior: FILE}}'";
  return "";
}

void judge(const std::filesystem::path& file, const LoopCheck& check, const Console& console) {
  if (!check.problem.empty()) throw FormatError(file, "", check.problem);
  if (!check.doubt.empty()) console.warning("{}: {}", file.string(), check.doubt);
}

}  // namespace

LoopCheck check_loop(const StageConfig& stage) {
  if (const std::string reason = why_untested(stage); !reason.empty()) return {"", reason};
  const LoopStability loop = loop_stability(stage.spec, stage.plant.value());
  LoopCheck out;
  if (!loop.tested) return out;
  out.largest_sensitivity = loop.largest_sensitivity;
  if (!loop.stable())
    out.problem = fmt::format(
        "the controller does not stabilize the plant: the closed loop is unstable at {:.4g} Hz and "
        "grows by {:.2g} % per sample. {}",
        loop.pole_hz, 100.0 * (loop.largest_pole - 1.0), kRemedy);
  else if (loop.largest_sensitivity > kPoorSensitivity)
    out.doubt = poor_margin(loop.largest_sensitivity, loop.sensitivity_hz);
  return out;
}

LoopCheck check_loop(const ExperimentConfig& config) {
  if (config.stage.spec.controller.by_peer) return check_loop(config.stage);
  return config.limits ? PriorLoop(config).check() : check_loop(config.stage);
}

void require_stable_loop(const StageConfig& stage, const Console& console) {
  judge(stage.file, check_loop(stage), console);
}

void require_stable_loop(const ExperimentConfig& config, const Console& console) {
  if (config.limits && !std::filesystem::exists(config.limits->prior))
    fail_file(config.limits->prior,
              "no such file; {} designs from it. Measure a pilot with 'stageid run' and write this "
              "file with 'stageid frf -o'",
              config.file.string());
  judge(config.limits ? config.limits->prior : config.stage.file, check_loop(config), console);
}

DesignPrediction predict_signals(const ExperimentConfig& config, const ExperimentPlan& plan,
                                 const Console& console) {
  if (config.limits) return {};
  if (const std::string reason = why_unpredictable(config.stage.spec, config.stage.plant);
      !reason.empty())
    console.warning(
        "{}: actuator and sensor signals are not predicted: {}. The limits are enforced by "
        "stopping the run. Begin with a low level",
        config.stage.file.string(), reason);
  return predict_closed_loop(plan, config.stage.spec, config.stage.plant);
}

void require_within_limits(const ExperimentConfig& config, const DesignPrediction& prediction,
                           bool forced, const Console& console) {
  const std::vector<std::string> violations = prediction.violations();
  if (forced)
    for (const std::string& violation : violations) console.warning("forced: " + violation);
  if (forced || violations.empty()) return;
  const std::string more =
      violations.size() == 1 ? "" : fmt::format(" (and {} more)", violations.size() - 1);
  fail_format(config.file, "", "{}{}; lower the level, or override with --force",
              violations.front(), more);
}

}  // namespace stageid
