// How often the true margins of a loop lie in the stated 95 % intervals, and the true curves in the stated discs.
//
//   margin_study [stages = 200] [first seed = 770001] [plant = contained] [most channels = 20]
//
// Random stages (judgement_stage.hpp) with at most this many pairs of sensor and actuator are measured in closed loop
// sample by sample, estimated and fitted with default settings. The plant is
//   contained   a free body with modes within the band: the model can be exact; white noise
//   beyond      with one or two modes above the band too
//   coloured    as contained, with white, flicker, drift or resonant noise
//   suspended   as contained, on a suspension of 0.02 Hz, far below the band
//   known       the same, and the fit is given that frequency (--rigid-body suspension:0.02)
// The true margins follow from the plant and the controller of the simulator by a search on a dense grid, with every
// axis opened explicitly. Prints every stage, and the shares with their 95 % intervals from the scatter of the stages.
#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <functional>
#include <map>
#include <numbers>
#include <stdexcept>
#include <string>
#include <vector>

#include "estimation/loop/loop_view.hpp"
#include "estimation/request/fit_request.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "frf/plant/plant_frf.hpp"
#include "hal/simulator/plant_spec.hpp"
#include "hal/simulator/rigid_body.hpp"
#include "hal/stage/motion_controller.hpp"
#include "tests/support/judgement/judgement_stage.hpp"
#include "tests/support/judgement/judgement_trouble.hpp"
#include "tools/control/stage_loop.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

using Complex = std::complex<double>;
using Eigen::MatrixXcd;

constexpr double kTwoPi = 2.0 * std::numbers::pi;

/// The loop of the simulated stage.
class TrueLoop {
 public:
  explicit TrueLoop(const JudgementStage& stage)
      : spec_(stage.spec),
        modes_(plant_modes(spec_.info, spec_.plant)),
        controller_(spec_.controller) {
    for (std::size_t a = 0; a < spec_.controller.axes.size(); ++a) {
      if (spec_.controller.axes[a].crossover_hz == 0.0) continue;
      MotionControllerSpec only = spec_.controller;
      for (std::size_t b = 0; b < only.axes.size(); ++b)
        if (b != a) only.axes[b] = {};
      names_.emplace_back(kRigidAxisNames[a]);
      axes_.emplace_back(only);
    }
  }
  const std::vector<std::string>& names() const { return names_; }
  /// L of every axis with the others closed, then det(I + G C).
  std::vector<Complex> at(double frequency_hz) const {
    const MatrixXcd G =
        sampled_response(modes_, spec_.info.delay_s, spec_.info.sample_rate_hz, frequency_hz);
    const MatrixXcd C = -controller_.response(frequency_hz);
    const MatrixXcd one = MatrixXcd::Identity(G.rows(), G.rows());
    std::vector<Complex> out;
    for (const MotionController& axis : axes_) {
      const MatrixXcd own = -axis.response(frequency_hz);
      const MatrixXcd others = C - own;
      const MatrixXcd closed = inverse(one + G * others) * G;
      out.push_back((closed * own).trace());  // of rank one
    }
    out.push_back((one + G * C).determinant());
    return out;
  }

  /// Frequencies of a dense search: logarithmic, and around every mode.
  std::vector<double> grid() const {
    std::vector<double> out;
    const double highest = 0.5 * spec_.info.sample_rate_hz;
    for (double f = 1e-4 * highest; f < highest; f *= 1.002) out.push_back(f);
    for (const PlantMode& mode : modes_)
      for (int i = -400; i <= 400; ++i) {
        const double f = mode.natural_frequency_hz * (1.0 + 0.02 * mode.damping_ratio * i);
        if (f > 1e-4 * highest && f < highest) out.push_back(f);
      }
    std::sort(out.begin(), out.end());
    out.push_back(highest);
    return out;
  }

 private:
  SimulatedSpec spec_;
  std::vector<PlantMode> modes_;
  MotionController controller_;
  std::vector<std::string> names_;
  std::vector<MotionController> axes_;
};

/// Margins of one curve, found on a dense grid and refined by bisection; absent ones are infinite.
struct TrueMargins {
  double gain_db = HUGE_VAL;
  double gain_reduction_db = HUGE_VAL;
  double phase_deg = HUGE_VAL;
  double delay_s = HUGE_VAL;
  double modulus = HUGE_VAL;  ///< least |offset + curve|
};

double bisected(double low, double high, const std::function<double(double)>& f) {
  const bool negative = f(low) < 0.0;
  for (int i = 0; i < 45; ++i) {
    const double middle = 0.5 * (low + high);
    ((f(middle) < 0.0) == negative ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// The least value near the middle of three neighbours, by ternary search.
double least_between(double low, double high, const std::function<double(double)>& f) {
  for (int i = 0; i < 60; ++i) {
    const double third = (high - low) / 3.0;
    if (f(low + third) < f(high - third))
      high -= third;
    else
      low += third;
  }
  return f(0.5 * (low + high));
}

TrueMargins margins_of(const std::vector<double>& hz, const std::vector<Complex>& curve,
                       double offset, const std::function<Complex(double)>& at) {
  TrueMargins out;
  std::size_t least = 0;
  for (std::size_t i = 0; i < hz.size(); ++i) {
    if (std::abs(offset + curve[i]) < std::abs(offset + curve[least])) least = i;
    if (i == 0) continue;
    // The curve is real at half the sample rate, the last point.
    const bool last = i + 1 == hz.size();
    if (last || (curve[i - 1].imag() < 0.0) != (curve[i].imag() < 0.0)) {
      const double f =
          last ? hz[i] : bisected(hz[i - 1], hz[i], [&](double x) { return at(x).imag(); });
      const double real = at(f).real();
      const double db = -20.0 * std::log10(std::abs(real));
      if (real < 0.0 && db > 0.0) out.gain_db = std::min(out.gain_db, db);
      if (real < 0.0 && db < 0.0) out.gain_reduction_db = std::min(out.gain_reduction_db, -db);
    }
    if ((std::abs(curve[i - 1]) < 1.0) != (std::abs(curve[i]) < 1.0)) {
      const double f = bisected(hz[i - 1], hz[i], [&](double x) { return std::abs(at(x)) - 1.0; });
      const double angle = std::arg(-at(f));
      const double lag = angle > 0.0 ? angle : angle + kTwoPi;
      out.phase_deg = std::min(out.phase_deg, 360.0 / kTwoPi * std::abs(angle));
      out.delay_s = std::min(out.delay_s, lag / (kTwoPi * f));
    }
  }
  out.modulus =
      least_between(hz[std::max<std::size_t>(least, 1) - 1], hz[std::min(least + 1, hz.size() - 1)],
                    [&](double f) { return std::abs(offset + at(f)); });
  return out;
}

/// Cases inside over all cases. Those of one stage depend on each other, so the interval is that of a ratio of sums over
/// independent stages.
class Count {
 public:
  void add(std::uint64_t stage, bool in) {
    Part& part = stages_[stage];
    part.inside += in ? 1.0 : 0.0;
    part.all += 1.0;
  }
  std::string text() const {
    Part sum;
    for (const auto& [stage, part] : stages_) {
      sum.inside += part.inside;
      sum.all += part.all;
    }
    const double share = sum.inside / sum.all;
    double square = 0.0;
    for (const auto& [stage, part] : stages_) square += std::pow(part.inside - share * part.all, 2);
    const double radius = 1.96 * std::sqrt(square) / sum.all;
    return fmt::format("{} of {}: {:.2f} % [{:.2f}, {:.2f}]", sum.inside, sum.all, 100.0 * share,
                       100.0 * (share - radius), 100.0 * (share + radius));
  }

 private:
  struct Part {
    double inside = 0.0, all = 0.0;
  };
  std::map<std::uint64_t, Part> stages_;
};

struct Study {
  std::uint64_t stage = 0;
  std::map<std::string, Count> counts;
  std::string outside;

  void add(const std::string& kind, const std::string& loop, const Margin& told, double truth) {
    const double radius = told.radius_95().value_or(0.0);
    const bool inside = std::abs(told.value - truth) <= radius;
    counts[kind].add(stage, inside);
    counts["all margins"].add(stage, inside);
    counts[told.extrapolated ? "outside the band" : "within the band"].add(stage, inside);
    if (!inside)
      outside += fmt::format(" {} {} {:.4g}+-{:.2g} true {:.4g} at {:.4g};", loop, kind, told.value,
                             radius, truth, told.frequency_hz);
  }
  /// Absent ones of both are equal; one of both only is a miss.
  void add(const std::string& kind, const std::string& loop, const std::optional<Margin>& told,
           double truth) {
    if (told && std::isfinite(truth)) return add(kind, loop, *told, truth);
    if (told.has_value() == std::isfinite(truth)) return;
    counts["margins of one only"].add(stage, false);
    outside += fmt::format(" {} {} of one only;", loop, kind);
  }
};

std::string study(const JudgementStage& stage, const FitRequest& request, Study& study) {
  const MemoryLog log = measure_with_trouble(stage, {});
  FitSetup setup = make_fit_setup(request, estimate_plant_frf({&log}, {}));
  setup.options.covariance = true;
  const FitResult fit = fit_model(setup, setup.options);
  if (!fit.trustworthy() || fit.covariance.sandwich.size() == 0)
    return "left out: " + fit.message();
  const LoopController controller =
      stage_loop(StageSpec{stage.spec.info, {}, stage.spec.controller}, fit.model);
  const auto [low_hz, high_hz] = fit.model.fit.band_hz;
  const Eigen::VectorXd lines =
      Eigen::ArrayXd::LinSpaced(20, std::log(low_hz), std::log(high_hz)).exp();
  const LoopView view = loop_view(fit.model, controller, fit.covariance.sandwich, lines);
  if (!view.margins)
    return fmt::format("left out: unstable, |z| = 1 + {:.2g} at {:.3g} Hz",
                       view.poles.largest_pole - 1.0, view.poles.pole_hz);
  const TrueLoop truth(stage);
  if (truth.names() != controller.loops) return "left out: other loops";
  const std::vector<double> hz = truth.grid();
  std::vector<std::vector<Complex>> curves(truth.names().size() + 1);
  for (const double f : hz) {
    const std::vector<Complex> values = truth.at(f);
    for (std::size_t k = 0; k < values.size(); ++k) curves[k].push_back(values[k]);
  }
  study.stage = stage.seed;
  study.outside.clear();
  for (std::size_t k = 0; k < truth.names().size(); ++k) {
    const TrueMargins exact =
        margins_of(hz, curves[k], 1.0, [&](double f) { return truth.at(f)[k]; });
    const LoopMargins& told = view.margins->loops[k];
    const std::string& name = truth.names()[k];
    study.add("gain margin", name, told.gain_db, exact.gain_db);
    study.add("gain reduction", name, told.gain_reduction_db, exact.gain_reduction_db);
    study.add("phase margin", name, told.phase_deg, exact.phase_deg);
    study.add("delay margin", name, told.delay_s, exact.delay_s);
    study.add("modulus margin", name, told.modulus, exact.modulus);
  }
  study.add(
      "least |det(I + L)|", "", view.margins->distance,
      margins_of(hz, curves.back(), 0.0, [&](double f) { return truth.at(f).back(); }).modulus);
  for (Eigen::Index k = 0; k < lines.size(); ++k) {
    const std::vector<Complex> exact = truth.at(lines[k]);
    for (Eigen::Index i = 0; i < view.loop.rows(); ++i)
      study.counts["discs of L"].add(
          stage.seed, std::abs(view.loop(i, k) - exact[i]) <= view.loop_radius(i, k));
    study.counts["discs of det(I + L)"].add(
        stage.seed, std::abs(view.determinant[k] - exact.back()) <= view.determinant_radius[k]);
  }
  return fmt::format("{} modes;{}", fit.model.submodels.size(), study.outside);
}

void become(const std::string& plant, JudgementStage& stage) {
  if (plant != "suspended" && plant != "known")
    for (double& hz : stage.spec.plant.suspension_hz) hz = 0.0;
  if (plant != "beyond") stage.spec.plant.in_plane_modes.resize(stage.modes_in_band);
  if (plant == "coloured") return;
  stage.noise.colour = NoiseColour::white;
  stage.noise.density = 0.0;
}

}  // namespace

int main(int argc, char** argv) {
  const int stages = argc > 1 ? std::atoi(argv[1]) : 200;
  auto seed = static_cast<std::uint64_t>(argc > 2 ? std::atoi(argv[2]) : 770001);
  const std::string plant = argc > 3 ? argv[3] : "contained";
  const auto most = static_cast<std::size_t>(argc > 4 ? std::atoi(argv[4]) : 20);
  FitRequest request;
  request.threads = 2;
  if (plant == "known") {
    request.rigid_body.kind = RigidBodyRequest::Kind::suspension;
    request.rigid_body.suspension_hz = {0.02};
  }
  Study all;
  for (int done = 0; done < stages; ++seed) {
    try {
      JudgementStage stage = draw_judgement_stage(seed);
      if (stage.spec.info.sensors.size() * stage.spec.info.actuators.size() > most) continue;
      become(plant, stage);
      const std::string told = study(stage, request, all);
      fmt::print("{}: {}; {}\n", seed, stage.description(), told);
      if (told.rfind("left out", 0) != 0) ++done;
    } catch (const std::runtime_error& problem) {  // no stable loop
      fmt::print("{}: left out: {}\n", seed, problem.what());
    }
    std::fflush(stdout);
  }
  for (const auto& [kind, count] : all.counts) fmt::print("{:20} {}\n", kind, count.text());
}
