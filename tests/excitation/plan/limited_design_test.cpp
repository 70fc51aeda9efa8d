#include "excitation/plan/limited_design.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "acquisition/record/experiment_plan_file.hpp"
#include "excitation/plan/joint_crest_reduction.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/support/process/temporary_directory.hpp"

namespace stageid::test_limited_design {

using Eigen::Index;

FrequencyGrid small_grid() {
  return FrequencyGrid::band(1000.0, 400, {.low_hz = 2.5, .high_hz = 200.0});
}

/// Two axes; u_p = r_p, y = a low pass of both. The variance increases with frequency, as for a displacement.
LimitedDesignSpec small_problem(const FrequencyGrid& grid, ExcitationScheme scheme) {
  LimitedDesignSpec spec;
  spec.experiment.scheme = scheme;
  spec.experiment.axes = {{"a", 1.0, {}}, {"b", 1.0, {}}};
  spec.experiment.realizations = 2;
  spec.experiment.crest_iterations = 60;
  spec.experiment.seed = 8;
  spec.cost.resize(2, grid.size());
  for (Index p = 0; p < 2; ++p) {
    BoundedSignal u;
    u.name = p == 0 ? "a" : "b";
    u.transfer = Eigen::MatrixXcd::Zero(2, grid.size());
    u.transfer.row(p).setOnes();
    u.peak_limit = p == 0 ? 10.0 : 20.0;
    u.reserve = 0.5;
    spec.signals.push_back(u);
    spec.cost.row(p) = grid.frequency_hz().array().square().square().transpose();
  }
  BoundedSignal y;
  y.name = "y";
  y.transfer.resize(2, grid.size());
  for (Index k = 0; k < grid.size(); ++k)
    y.transfer.col(k).setConstant(1.0 / std::complex<double>(1.0, grid.frequency_hz()[k] / 5.0));
  y.peak_limit = 4.0;
  spec.signals.push_back(y);
  BoundedSignal velocity = y;
  velocity.kind = SignalKind::derivative;
  velocity.peak_limit = 400.0;
  spec.signals.push_back(velocity);
  return spec;
}

double cost_of(const LimitedDesignSpec& spec, const ExperimentPlan& plan) {
  const Eigen::ArrayXXd power = plan.amplitude().array().square();
  return (power > 0.0).select(spec.cost.array() / power, 0.0).sum();  // on the lines each axis has
}

/// Predicted again, run by run, from the designed plan.
double largest_use(const LimitedDesignSpec& spec, const ExperimentPlan& plan) {
  SignalPredictor predictor(plan.grid());
  double largest = 0.0;
  for (const RunId run : plan.runs()) {
    const std::vector<SignalPeak> peaks = predictor.predict(spec.signals, plan.spectrum(run));
    for (std::size_t s = 0; s < peaks.size(); ++s)
      largest = std::max(largest, limit_use(spec.signals[s], peaks[s]));
  }
  return largest;
}

class LimitedDesignOf : public testing::TestWithParam<ExcitationScheme> {};

TEST_P(LimitedDesignOf, UsesTheTightestLimitToTheSafetyFactorAndNoneBeyond) {
  const FrequencyGrid grid = small_grid();
  LimitedDesignSpec spec = small_problem(grid, GetParam());
  spec.safety = 0.8;
  const LimitedDesign design = design_within_limits(grid, spec);
  EXPECT_NEAR(largest_use(spec, design.plan), 0.8, 1e-9);
  EXPECT_NEAR(design.cost, cost_of(spec, design.plan), 1e-9 * design.cost);
  double told = 0.0;
  for (std::size_t s = 0; s < spec.signals.size(); ++s)
    told = std::max(told, limit_use(spec.signals[s], design.peaks[s]));
  EXPECT_NEAR(told, 0.8, 1e-9);
}

TEST_P(LimitedDesignOf, HasLessThanHalfTheVarianceOfFlatRandomPhases) {
  const FrequencyGrid grid = small_grid();
  const LimitedDesignSpec spec = small_problem(grid, GetParam());
  ExperimentSpec flat = spec.experiment;
  flat.crest_iterations = 0;
  const ExperimentPlan start(grid, flat);
  // The use is affine in the level: reserve + level * use of one unit.
  const double most = largest_use(spec, start);
  double level = 0.0;
  for (double high = 100.0 / most, low = 0.0; high - low > 1e-9 * high;) {
    level = 0.5 * (low + high);
    for (ExcitationAxis& axis : flat.axes) axis.level = level;
    (largest_use(spec, ExperimentPlan(grid, flat)) > spec.safety ? high : low) = level;
  }
  const LimitedDesign design = design_within_limits(grid, spec);
  EXPECT_LT(2.0 * design.cost, cost_of(spec, ExperimentPlan(grid, flat)));
}

INSTANTIATE_TEST_SUITE_P(Schemes, LimitedDesignOf,
                         testing::Values(ExcitationScheme::single_axis,
                                         ExcitationScheme::orthogonal_dft,
                                         ExcitationScheme::orthogonal_hadamard,
                                         ExcitationScheme::zippered));

TEST(LimitedDesign, AnRmsLimitHoldsToo) {
  const FrequencyGrid grid = small_grid();
  LimitedDesignSpec spec = small_problem(grid, ExcitationScheme::orthogonal_dft);
  spec.signals[0].rms_limit = 1.0;
  spec.signals[0].rms_time_constant_s = 0.1;
  const LimitedDesign design = design_within_limits(grid, spec);
  EXPECT_LE(design.peaks[0].rms, spec.safety * 1.0 * (1.0 + 1e-12));
  EXPECT_GT(design.peaks[0].rms, 0.8 * spec.safety);
}

TEST(LimitedDesign, IsTheSameAgainAndFromAFile) {
  const FrequencyGrid grid = small_grid();
  const LimitedDesignSpec spec = small_problem(grid, ExcitationScheme::orthogonal_dft);
  const LimitedDesign once = design_within_limits(grid, spec);
  const LimitedDesign again = design_within_limits(grid, spec);
  EXPECT_EQ(once.plan.amplitude(), again.plan.amplitude());
  EXPECT_EQ(once.plan.phase_rad(1), again.plan.phase_rad(1));
  const test::TemporaryDirectory directory;
  write_experiment_plan(directory / "excitation.h5", once.plan);
  const ExperimentPlan read = read_experiment_plan(directory / "excitation.h5");
  EXPECT_EQ(read.phase_rad(1), once.plan.phase_rad(1));
  EXPECT_EQ(read.excitation({1, 1}), once.plan.excitation({1, 1}));
}

TEST(LimitedDesign, RefusesWhatCannotBeDesigned) {
  const FrequencyGrid grid = small_grid();
  const LimitedDesignSpec good = small_problem(grid, ExcitationScheme::orthogonal_dft);
  const auto refuse = [&](void (*change)(LimitedDesignSpec&), const char* text) {
    LimitedDesignSpec spec = good;
    change(spec);
    test::expect_error<std::invalid_argument>([&] { design_within_limits(grid, spec); }, "", text);
  };
  refuse([](auto& s) { s.cost.conservativeResize(2, 3); }, "cost is 2 x 3");
  refuse([](auto& s) { s.safety = 1.1; }, "safety is 1.1");
  refuse([](auto& s) { s.experiment.crest_iterations = 0; }, "crest_iterations must be 1");
  refuse([](auto& s) { s.signals[0].transfer.conservativeResize(1, 80); }, "a: transfer");
  refuse([](auto& s) { s.signals[0].transfer(0, 0) = NAN; }, "finite");
  refuse([](auto& s) { s.signals[0].peak_limit = 0.0; }, "a: limits must be positive");
  refuse([](auto& s) { s.signals[0].reserve = 9.5; }, "uses up the limit");
  refuse([](auto& s) { s.signals.clear(); }, "excitation power");
}

// Random phases of 80 lines have peaks of 2.7 to 3.5 times the rms. Here two signals of two experiments each must be
// reduced jointly.
TEST(JointCrest, LowersAllSignalsTogetherAndKeepsTheAmplitudes) {
  const FrequencyGrid grid = small_grid();
  LimitedDesignSpec spec = small_problem(grid, ExcitationScheme::orthogonal_dft);
  for (BoundedSignal& signal : spec.signals) signal.reserve = 0.0;
  spec.experiment.crest_iterations = 0;
  const ExperimentPlan plan(grid, spec.experiment);
  const auto largest = [&](const Eigen::MatrixXd& phase_rad) {
    ExperimentSpec known = spec.experiment;
    known.crest_iterations = 1;
    return largest_use(spec, ExperimentPlan(grid, known, {phase_rad, phase_rad}));
  };
  const JointCrestProblem problem{grid, plan.mixing(), spec.signals, plan.amplitude()};
  const Eigen::MatrixXd before = plan.phase_rad(0);
  const Eigen::MatrixXd after = reduce_joint_crest(problem, before, 200);
  EXPECT_LT(largest(after), 0.75 * largest(before));
  EXPECT_TRUE((after.array() >= 0.0).all() && (after.array() < 6.2831853071795865).all());
  JointCrestProblem easy = problem;
  easy.enough = 1e9;
  EXPECT_EQ(reduce_joint_crest(easy, before, 200), before);
}

}  // namespace stageid::test_limited_design
