#include "excitation/plan/experiment_plan.hpp"

#include <gtest/gtest.h>

#include <complex>
#include <functional>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

#include "excitation/multisine/dft.hpp"
#include "excitation/multisine/multisine.hpp"
#include "excitation/multisine/random_stream.hpp"
#include "tests/acquisition/files/expect_error.hpp"
#include "tests/excitation/reference/multisine_reference.hpp"

namespace stageid::test_experiment_plan {

constexpr double kEps = std::numeric_limits<double>::epsilon();

FrequencyGrid small_grid() {
  return FrequencyGrid::band(1000.0, 200, {.low_hz = 5.0, .high_hz = 300.0});
}

ExperimentSpec spec_of(int axes, ExcitationScheme scheme) {
  ExperimentSpec spec;
  spec.scheme = scheme;
  for (int p = 0; p < axes; ++p) {
    spec.axes.push_back({.channel = std::to_string(p + 1), .level = 1.0 + 0.5 * p});
    spec.axes.back().channel.insert(0, 1, 'z');
  }
  spec.realizations = 3;
  spec.seed = 17;
  return spec;
}

Eigen::VectorXd rms_of_columns(const Eigen::MatrixXd& x) {
  return x.colwise().norm().transpose() / std::sqrt(static_cast<double>(x.rows()));
}

TEST(ExperimentPlan, CountsRunsSamplesAndSecondsOfThePapersExperiment) {
  ExperimentSpec spec = spec_of(13, ExcitationScheme::single_axis);
  spec.realizations = 10;
  spec.periods = 10;
  const ExperimentPlan plan(
      FrequencyGrid::band(10'000.0, 40'000, {.low_hz = 0.25, .high_hz = 2000.0}), spec);
  EXPECT_EQ(plan.experiments(), 13);
  EXPECT_EQ(plan.samples_per_run(), 440'000);
  EXPECT_DOUBLE_EQ(plan.duration_s(), 5720.0);
  const std::vector<RunId> runs = plan.runs();
  ASSERT_EQ(runs.size(), 130U);
  EXPECT_EQ(runs[0], (RunId{0, 0}));
  EXPECT_EQ(runs[12], (RunId{0, 12}));
  EXPECT_EQ(runs[13], (RunId{1, 0}));
  EXPECT_EQ(runs[129], (RunId{9, 12}));
}

TEST(ExperimentPlan, SingleAxisExcitesOneAxisARun) {
  const ExperimentPlan plan(small_grid(), spec_of(3, ExcitationScheme::single_axis));
  for (const RunId run : plan.runs()) {
    Eigen::VectorXd wanted = Eigen::VectorXd::Zero(3);
    wanted[run.experiment] = 1.0 + 0.5 * run.experiment;
    const Eigen::MatrixXd excitation = plan.excitation(run);
    ASSERT_EQ(excitation.rows(), 200);
    ASSERT_EQ(excitation.cols(), 3);
    EXPECT_LT((rms_of_columns(excitation) - wanted).cwiseAbs().maxCoeff(), 32.0 * kEps);
    for (int p = 0; p < 3; ++p) {
      if (p == run.experiment) continue;
      EXPECT_TRUE(excitation.col(p).isZero(0.0)) << "axis " << p << " must stand still";
      EXPECT_TRUE(plan.spectrum(run).row(p).isZero(0.0));
    }
  }
}

TEST(ExperimentPlan, SingleAxisIsTheMultisineOfItsStream) {
  const ExperimentPlan plan(small_grid(), spec_of(3, ExcitationScheme::single_axis));
  const Multisine wanted =
      random_phase_multisine(small_grid(), {.level = 1.5, .seed = stream_seed(17, 2, 1)});
  EXPECT_LT((plan.excitation({2, 1}).col(1) - wanted.samples).cwiseAbs().maxCoeff(), 64.0 * kEps);
}

TEST(ExperimentPlan, SimultaneousPlaysGivenPhasesInOneRunPerRealization) {
  const FrequencyGrid grid = small_grid();
  ExperimentSpec spec = spec_of(2, ExcitationScheme::simultaneous);
  spec.axes[1].phase_rad = Eigen::VectorXd::LinSpaced(grid.size(), -1.0, 7.0);
  const ExperimentPlan plan(grid, spec);
  EXPECT_EQ(plan.runs().size(), 3U);
  for (const RunId run : plan.runs()) {
    const Eigen::MatrixXcd R = plan.spectrum(run);
    for (Eigen::Index k = 0; k < grid.size(); ++k) {
      const std::complex<double> wanted =
          std::polar(0.5 * plan.amplitude()(1, k), spec.axes[1].phase_rad[k]);
      EXPECT_NEAR(std::abs(R(1, k) - wanted), 0.0, 1e-12);
    }
  }
  EXPECT_NE(plan.phase_rad(0).row(0), plan.phase_rad(1).row(0));
  spec.crest_iterations = 5;
  EXPECT_THROW(ExperimentPlan(grid, spec), std::invalid_argument);
  spec.crest_iterations = 0;
  spec.axes[1].phase_rad.conservativeResize(1);
  EXPECT_THROW(ExperimentPlan(grid, spec), std::invalid_argument);
}

TEST(ExperimentPlan, PhasesAreThoseOfTheIndependentReference) {
  ExperimentSpec spec = spec_of(4, ExcitationScheme::orthogonal_dft);
  spec.seed = ~std::uint64_t{4};  // 2^64 - 5
  const FrequencyGrid grid(1000.0, 200, {1, 3, 5, 7, 9, 11, 13, 15});
  const Eigen::VectorXd phases = ExperimentPlan(grid, spec).phase_rad(2).row(3);
  for (Eigen::Index k = 0; k < 8; ++k) {
    EXPECT_EQ(phases[k], test::reference::kStreamPhaseRad[k]);
  }
}

struct Orthogonal {
  ExcitationScheme scheme;
  int axes;
};
class OrthogonalPlan : public testing::TestWithParam<Orthogonal> {};

TEST_P(OrthogonalPlan, ExperimentsAreOrthogonalOnEveryLine) {
  const auto [scheme, n] = GetParam();
  const ExperimentPlan plan(small_grid(), spec_of(n, scheme));
  for (int m = 0; m < 3; ++m) {
    std::vector<Eigen::MatrixXcd> spectra;
    for (int e = 0; e < n; ++e) spectra.push_back(plan.spectrum({m, e}));
    for (Eigen::Index k = 0; k < plan.grid().size(); ++k) {
      // R R^H = n D^2, D the size A / 2 of each axis: sums of n products of size D^2.
      Eigen::MatrixXcd R(n, n);
      for (int e = 0; e < n; ++e)
        for (int p = 0; p < n; ++p) R(p, e) = spectra[e](p, k) / (plan.amplitude()(p, k) / 2.0);
      const Eigen::MatrixXcd adjoint = R.adjoint();
      const Eigen::MatrixXcd gram = R * adjoint;
      EXPECT_LT((gram - n * Eigen::MatrixXcd::Identity(n, n)).cwiseAbs().maxCoeff(),
                16.0 * n * kEps)
          << "line " << k;
    }
  }
}

TEST_P(OrthogonalPlan, EveryAxisHasItsLevelInEveryRunAndNewPhasesInEveryRealization) {
  const auto [scheme, n] = GetParam();
  const ExperimentPlan plan(small_grid(), spec_of(n, scheme));
  for (const RunId run : plan.runs()) {
    const Eigen::VectorXd rms = rms_of_columns(plan.excitation(run));
    for (int p = 0; p < n; ++p) EXPECT_NEAR(rms[p], 1.0 + 0.5 * p, 64.0 * rms[p] * kEps);
  }
  for (int m = 1; m < 3; ++m) {
    EXPECT_GT((plan.phase_rad(m) - plan.phase_rad(m - 1)).cwiseAbs().minCoeff(), 0.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Schemes, OrthogonalPlan,
                         testing::Values(Orthogonal{ExcitationScheme::orthogonal_dft, 1},
                                         Orthogonal{ExcitationScheme::orthogonal_dft, 2},
                                         Orthogonal{ExcitationScheme::orthogonal_dft, 3},
                                         Orthogonal{ExcitationScheme::orthogonal_dft, 13},
                                         Orthogonal{ExcitationScheme::orthogonal_dft, 17},
                                         Orthogonal{ExcitationScheme::orthogonal_hadamard, 2},
                                         Orthogonal{ExcitationScheme::orthogonal_hadamard, 12},
                                         Orthogonal{ExcitationScheme::orthogonal_hadamard, 16}));

TEST(ExperimentPlan, AxisPIsTurnedByPTimesEOverN) {
  const ExperimentPlan plan(small_grid(), spec_of(5, ExcitationScheme::orthogonal_dft));
  const Eigen::MatrixXcd first = plan.spectrum({1, 0});
  const Eigen::MatrixXcd fourth = plan.spectrum({1, 3});
  for (int p = 0; p < 5; ++p) {
    const std::complex<double> turn = std::polar(1.0, 2.0 * std::numbers::pi * p * 3 / 5.0);
    for (Eigen::Index k = 0; k < plan.grid().size(); ++k) {
      EXPECT_LT(std::abs(fourth(p, k) - turn * first(p, k)), 16.0 * kEps) << p;
    }
  }
}

TEST(ExperimentPlan, SpectrumIsTheDftOfTheExcitation) {
  for (const auto scheme : {ExcitationScheme::single_axis, ExcitationScheme::orthogonal_dft}) {
    const ExperimentPlan plan(small_grid(), spec_of(3, scheme));
    const Eigen::MatrixXd excitation = plan.excitation({1, 2});
    const Eigen::MatrixXcd wanted = plan.spectrum({1, 2});
    RealDft dft(200);
    for (int p = 0; p < 3; ++p) {
      const auto spectrum = dft.forward(excitation.col(p));
      Eigen::VectorXcd rest =
          Eigen::Map<const Eigen::VectorXcd>(spectrum.data(), dft.half_size()) / 200.0;
      for (Eigen::Index k = 0; k < plan.grid().size(); ++k) {
        rest[plan.grid().lines()[k]] -= wanted(p, k);
      }
      EXPECT_LT(rest.cwiseAbs().maxCoeff(), 32.0 * kEps) << "axis " << p;
    }
  }
}

TEST(ExperimentPlan, PeakIsReachedOnceAndNeverPassedWithOneAmplitudeForAllRuns) {
  for (const auto scheme : {ExcitationScheme::single_axis, ExcitationScheme::orthogonal_dft,
                            ExcitationScheme::zippered}) {
    ExperimentSpec spec = spec_of(4, scheme);
    spec.scaling = AmplitudeScaling::peak;
    spec.crest_iterations = scheme == ExcitationScheme::zippered ? 50 : 0;
    const ExperimentPlan plan(small_grid(), spec);
    Eigen::VectorXd peak = Eigen::VectorXd::Zero(4);
    for (const RunId run : plan.runs()) {
      peak = peak.cwiseMax(plan.excitation(run).cwiseAbs().colwise().maxCoeff().transpose());
      const Eigen::MatrixXd size = plan.spectrum(run).cwiseAbs();
      for (int p = 0; p < 4; ++p) {
        if (size.row(p).isZero(0.0)) continue;
        EXPECT_LT((2.0 * size.row(p) - plan.amplitude().row(p)).cwiseAbs().maxCoeff(), 8.0 * kEps);
      }
    }
    for (int p = 0; p < 4; ++p) EXPECT_NEAR(peak[p], 1.0 + 0.5 * p, 64.0 * peak[p] * kEps);
  }
}

TEST(ExperimentPlan, CrestReductionLowersEveryRunAndKeepsOrthogonality) {
  for (const auto scheme : {ExcitationScheme::single_axis, ExcitationScheme::orthogonal_hadamard}) {
    ExperimentSpec spec = spec_of(4, scheme);
    const ExperimentPlan random(small_grid(), spec);
    spec.crest_iterations = 60;
    const ExperimentPlan reduced(small_grid(), spec);
    EXPECT_EQ(reduced.amplitude(), random.amplitude());
    EXPECT_EQ(ExperimentPlan(small_grid(), spec).phase_rad(2), reduced.phase_rad(2))
        << "the number of threads must not matter";
    for (const RunId run : reduced.runs()) {
      const int p = run.experiment;  // Hadamard signs do not change the crest factor
      EXPECT_LT(crest_factor(reduced.excitation(run).col(p)), 1.9);
    }
    EXPECT_GT((reduced.phase_rad(0) - reduced.phase_rad(1)).cwiseAbs().minCoeff(), 0.0);
  }
}

TEST(ExperimentPlan, ZipperedAxesShareARunAndNoLine) {
  ExperimentSpec spec = spec_of(3, ExcitationScheme::zippered);
  spec.periods = 4;
  spec.crest_iterations = 50;
  spec.axes[1].shape = Eigen::VectorXd::LinSpaced(small_grid().size(), 1.0, 5.0);
  const ExperimentPlan plan(small_grid(), spec);
  EXPECT_EQ(plan.experiments(), 1);
  EXPECT_EQ(plan.axes(), 3);
  EXPECT_EQ(plan.runs(), (std::vector<RunId>{{0, 0}, {1, 0}, {2, 0}}));
  EXPECT_DOUBLE_EQ(plan.duration_s(), 3.0 * 1.0);  // realizations x (1 + 4) periods of 0.2 s
  RealDft dft(200);
  for (const RunId run : plan.runs()) {
    const Eigen::MatrixXd excitation = plan.excitation(run);
    EXPECT_LT((rms_of_columns(excitation) - Eigen::Vector3d(1.0, 1.5, 2.0)).cwiseAbs().maxCoeff(),
              32.0 * kEps);
    for (int p = 0; p < 3; ++p) {
      EXPECT_LT(crest_factor(excitation.col(p)), 2.0);
      const auto spectrum = dft.forward(excitation.col(p));
      for (std::size_t k = 0; k < plan.grid().lines().size(); ++k) {
        const double amplitude = std::abs(spectrum[plan.grid().lines()[k]]) / 100.0;
        const double wanted = plan.amplitude()(p, static_cast<Eigen::Index>(k));
        EXPECT_EQ(wanted > 0.0, k % 3 == static_cast<std::size_t>(p)) << k;
        EXPECT_NEAR(amplitude, wanted, 64.0 * kEps) << k;
      }
    }
  }
  // The shape is that on the lines of the axis.
  EXPECT_NEAR(plan.amplitude()(1, 4) / plan.amplitude()(1, 1),
              spec.axes[1].shape[4] / spec.axes[1].shape[1], 8.0 * kEps);
}

TEST(ExperimentPlan, RunsFollowTheSeedAlone) {
  ExperimentSpec spec = spec_of(2, ExcitationScheme::orthogonal_dft);
  const Eigen::MatrixXd first = ExperimentPlan(small_grid(), spec).excitation({1, 1});
  EXPECT_EQ(ExperimentPlan(small_grid(), spec).excitation({1, 1}), first);
  spec.realizations = 9;  // a longer experiment begins like a shorter one
  EXPECT_EQ(ExperimentPlan(small_grid(), spec).excitation({1, 1}), first);
  spec.seed = 18;
  EXPECT_NE(ExperimentPlan(small_grid(), spec).excitation({1, 1}), first);
}

void expect_refused(const std::function<void(ExperimentSpec&)>& change, const std::string& word) {
  ExperimentSpec spec = spec_of(3, ExcitationScheme::single_axis);
  change(spec);
  test::expect_error<std::invalid_argument>([&] { ExperimentPlan(small_grid(), spec); },
                                            "experiment: ", word);
}

TEST(ExperimentPlan, NamesTheFieldThatIsWrong) {
  const Eigen::Index lines = small_grid().size();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expect_refused([](auto& s) { s.realizations = 0; }, "realizations");
  expect_refused([](auto& s) { s.periods = 0; }, "periods");
  expect_refused([](auto& s) { s.transient_periods = -1; }, "transient_periods");
  expect_refused([](auto& s) { s.crest_iterations = -1; }, "crest_iterations");
  expect_refused([](auto& s) { s.axes.clear(); }, "axes");
  expect_refused([](auto& s) { s.axes[1].channel = ""; }, "axes[1].channel");
  expect_refused([](auto& s) { s.axes[2].channel = "z1"; }, "duplicate channel 'z1'");
  expect_refused([](auto& s) { s.axes[2].level = 0.0; }, "axes[2].level (z3)");
  expect_refused([nan](auto& s) { s.axes[0].level = nan; }, "axes[0].level");
  expect_refused([&](auto& s) { s.axes[0].shape.setOnes(lines - 1); }, "axes[0].shape");
  expect_refused([&](auto& s) { s.axes[0].shape.setZero(lines); }, "axes[0].shape");
  expect_refused(
      [&](auto& s) {
        s.axes[0].shape.setOnes(lines);
        s.axes[0].shape[1] = nan;
      },
      "at line 3");
  expect_refused([](auto& s) { s.scheme = ExcitationScheme::orthogonal_hadamard; }, "2 and 4");
  expect_refused([](auto& s) { s = spec_of(100, ExcitationScheme::zippered); },
                 "distributes 30 lines over 100 axes");
}

TEST(ExperimentPlan, LeavesOutWhatIsDone) {
  const ExperimentPlan plan(small_grid(), spec_of(3, ExcitationScheme::single_axis));
  EXPECT_EQ(plan.runs_without({}), plan.runs());
  const std::vector<RunId> left = plan.runs_without({{0, 0}, {0, 2}, {7, 7}});
  ASSERT_EQ(left.size(), plan.runs().size() - 2);
  EXPECT_EQ(left[0], (RunId{0, 1}));
  EXPECT_EQ(left[1], (RunId{1, 0}));
  EXPECT_TRUE(plan.runs_without(plan.runs()).empty());
}

TEST(ExperimentPlan, RefusesRunsThatItDoesNotHave) {
  const ExperimentPlan plan(small_grid(), spec_of(3, ExcitationScheme::single_axis));
  for (const RunId run : {RunId{3, 0}, RunId{0, 3}, RunId{-1, 0}, RunId{0, -1}}) {
    EXPECT_THROW(plan.excitation(run), std::invalid_argument);
    EXPECT_THROW(plan.spectrum(run), std::invalid_argument);
  }
  EXPECT_THROW(plan.phase_rad(3), std::invalid_argument);
}

}  // namespace stageid::test_experiment_plan
