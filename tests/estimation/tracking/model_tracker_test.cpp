#include "estimation/tracking/model_tracker.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "estimation/tracking/tracked_response.hpp"
#include "excitation/decompositions/decompositions.hpp"
#include "tests/estimation/tracked_stage.hpp"
#include "tests/support/process/error_message.hpp"

namespace stageid::test_model_tracker {

using test::LoopSpectra;
using test::model_of;
using test::StageProperties;
using test::tracked_lines_hz;

/// A stage, and a tracker that has watched some periods of it.
struct Watched {
  explicit Watched(std::uint64_t seed, int periods = 0, const AdditiveModel& model = model_of({}))
      : loop(seed), tracker(model, tracked_lines_hz(), {}) {
    watch(periods);
  }
  TrackedPeriod watch(int periods) {
    TrackedPeriod last;
    for (int t = 0; t < periods; ++t) {
      last = tracker.add(loop.next());
      EXPECT_FALSE(last.change) << name(*last.change) << " in period " << t;
    }
    return last;
  }
  /// The change that the tracker finds in the next periods.
  StageChange next_change() {
    for (int t = 0; t < 40; ++t)
      if (const auto period = tracker.add(loop.next()); period.change) return *period.change;
    ADD_FAILURE() << "no change";
    return {};
  }
  std::string name(const StageChange& change) const {
    return describe(change.what, tracker.parameters(), model_of({}));
  }
  /// The stage of the model, changed so.
  void become(const std::function<void(StageProperties&)>& change) {
    StageProperties stage;
    change(stage);
    loop.become(stage);
  }
  /// The estimates, in their deviations from the truth.
  Eigen::VectorXd errors(const Eigen::VectorXd& truth = Eigen::VectorXd::Zero(14)) const {
    return (tracker.estimate() - truth).cwiseQuotient(tracker.covariance().diagonal().cwiseSqrt());
  }
  LoopSpectra loop;
  ModelTracker tracker;
};

void expect_small(const Eigen::VectorXd& errors) {
  EXPECT_LT(errors.cwiseAbs().maxCoeff(), 4.5) << errors.transpose();
}

/// By three half-power bandwidths.
void move_second_mode(StageProperties& stage) { stage.frequency_hz[1] *= 1.06; }

TEST(ModelTracker, LearnsThenWatches) {
  Watched w(1);
  EXPECT_EQ(w.tracker.reference().chi_square.size(), 0);
  EXPECT_TRUE(w.watch(32).learning);
  const TrackedPeriod first = w.watch(1);
  EXPECT_FALSE(first.learning);
  EXPECT_EQ(first.noise_power.size(), 0) << "there is no difference yet";
  EXPECT_LT(first.largest_statistic, first.threshold);
  ASSERT_EQ(first.statistics.size(), 14 + 2) << "properties, and the noise of each sensor";
  EXPECT_LE(first.statistics.maxCoeff(), first.largest_statistic);
  EXPECT_EQ(w.watch(1).noise_power.size(), 2);
}

TEST(ModelTracker, EstimatesOfAnUnchangedStageAreWithinTheirDeviations) {
  constexpr int kRuns = 10;
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(14);
  Eigen::VectorXd chi_square = Eigen::VectorXd::Zero(2);
  for (int run = 0; run < kRuns; ++run) {
    Watched w(100 + static_cast<std::uint64_t>(run), 32 + 30);
    const Eigen::VectorXd ratio = w.errors();
    squares += ratio.cwiseAbs2() / kRuns;
    EXPECT_LT(ratio.cwiseAbs().maxCoeff(), 4.5) << ratio.transpose();
    chi_square += w.tracker.reference().chi_square / kRuns;
  }
  // 10 runs of about 10 independent estimates: one deviation is 0.14.
  EXPECT_NEAR(squares.mean(), 1.0, 0.4) << squares.transpose();
  // The model is exact. 10 runs of 120 values of a sensor: one deviation is 0.04; weights from few periods raise the
  // mean, the estimated parameters lower it.
  for (const double value : chi_square) EXPECT_NEAR(value, 1.0, 0.2);
}

TEST(ModelTracker, TheResponseHasTheTrackedChangesAndTheirCovariance) {
  StageProperties changed;
  changed.frequency_hz[1] *= 1.0 + 1e-4;
  changed.sensor_gain[0] = 1.001;
  Watched w(5);
  w.loop.become(changed);
  w.watch(32 + 30);
  const Eigen::VectorXd x = w.tracker.estimate();
  const TrackedResponse response(model_of({}), w.tracker.parameters(), tracked_lines_hz());
  const Eigen::MatrixXcd P = w.tracker.response();
  EXPECT_EQ(P, response.at(x));
  // By differences, along the principal directions of the covariance.
  const auto axes = symmetric_eigen(w.tracker.covariance());
  Eigen::MatrixXd variance = Eigen::MatrixXd::Zero(P.rows(), P.cols());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Eigen::VectorXd step =
        axes.eigenvectors().col(i) * std::sqrt(std::max(axes.eigenvalues()[i], 0.0));
    variance += (0.5 * (response.at(x + step) - response.at(x - step))).cwiseAbs2();
  }
  const Eigen::MatrixXd told = w.tracker.response_variance();
  EXPECT_LT(((told - variance).array() / variance.array()).abs().maxCoeff(), 1e-3);
  const Eigen::MatrixXcd truth = TrackedResponse(model_of(changed), {}, tracked_lines_hz()).at({});
  const Eigen::ArrayXXd ratio = (P - truth).cwiseAbs2().array() / told.array();
  EXPECT_LT(ratio.mean(), 4.0) << "the few tracked values are common to all lines";
}

// With feedback, the noise of the residual depends on the parameters, which settle far from the model here.
TEST(ModelTracker, AWrongResidueShowsInTheReferenceAndCausesNoAlarms) {
  AdditiveModel model = model_of({});
  // Not a gain of a channel: one entry of one mode.
  model.submodels[2].numerator[0](1, 0) *= 1.5;
  const Watched w(2, 32 + 60, model);
  EXPECT_GT(w.tracker.reference().chi_square[1], 3.0);
  EXPECT_GT(w.tracker.reference().relative_error[1], 1e-3);
  EXPECT_LT(w.tracker.reference().relative_error[1], 0.3);
}

// A resonance is a small part of the power of the response, and a large one of what the model is for.
TEST(ModelTracker, AModeElsewhereIsALargeErrorOfTheModel) {
  Watched w(3);
  w.become([](StageProperties& stage) { stage.frequency_hz[3] *= 1.1; });
  w.watch(32);
  EXPECT_GT(w.tracker.reference().model_error.maxCoeff(), 0.2);
}

TEST(ModelTracker, TheErrorOfTheModelIsThatBeforeTrackedChanges) {
  Watched w(3);
  w.become([](StageProperties& stage) { stage.sensor_gain[1] = 1.4; });
  w.watch(32);
  // The response of y2 is 1.4 times that of the model.
  EXPECT_NEAR(w.tracker.reference().model_error[1], 0.4 / 1.4, 0.01);
  EXPECT_LT(w.tracker.reference().model_error[0], 0.01);
  EXPECT_LT(w.tracker.reference().relative_error.maxCoeff(), 0.01);
}

struct Case {
  std::string name;
  double size;
  std::function<void(StageProperties&)> change;
};

std::vector<Case> cases() {
  const std::string gains = "gains of all sensors or of all actuators";
  return {
      {"frequency of the mode at 122 Hz", 2e-3, [](auto& s) { s.frequency_hz[1] *= 1.002; }},
      {"frequency of the mode at 122 Hz", 0.06, move_second_mode},
      {"frequency of the mode at 122 Hz", -0.06, [](auto& s) { s.frequency_hz[1] *= 0.94; }},
      // General viscous damping.
      {"frequency of the mode at 253 Hz", -4e-3, [](auto& s) { s.frequency_hz[3] *= 0.996; }},
      {"damping ratio of the mode at 71 Hz", 0.5, [](auto& s) { s.damping_ratio[0] *= 1.5; }},
      {"gain of sensor 'y2'", -0.06, [](auto& s) { s.sensor_gain[1] = 0.94; }},
      {"gain of actuator 'a3'", 0.06, [](auto& s) { s.actuator_gain[2] = 1.06; }},
      {"delay", 1e-4, [](auto& s) { s.delay_s += 1e-4; }},
      {"delay", -1e-4, [](auto& s) { s.delay_s -= 1e-4; }},
      {"frequencies of all modes", -2e-3,
       [](auto& s) {
         for (double& hz : s.frequency_hz) hz *= 0.998;
       }},
      {gains, 0.06, [](auto& s) { s.sensor_gain *= 1.06; }},
      {gains, 0.06, [](auto& s) { s.actuator_gain *= 1.06; }},
  };
}

TEST(ModelTracker, NamesAndSizesEachChange) {
  std::uint64_t seed = 200;
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    Watched w(++seed, 40);
    w.become(c.change);
    const StageChange change = w.next_change();
    EXPECT_EQ(w.name(change), c.name);
    EXPECT_LT(std::abs(change.size - c.size), 4.0 * change.deviation) << change.size;
    EXPECT_LT(change.deviation, 0.25 * std::abs(c.size)) << "too small to be tested";
    EXPECT_GT(change.probability, 0.9);
    EXPECT_LT(change.other_probability, 0.1);
    EXPECT_GT(change.periods, 0);
  }
}

// In the response before the change, the noise in U raises that of the residual up to fifty times with these seeds.
TEST(ModelTracker, DoesNotTakeALargeChangeForNoise) {
  for (const std::uint64_t seed : {5, 18, 29}) {
    Watched w(seed, 40);
    w.become(move_second_mode);
    EXPECT_EQ(w.name(w.next_change()), "frequency of the mode at 122 Hz");
  }
}

/// Size of a change of noise by a factor, in its deviations from the truth.
double error_of_noise_change(double factor, std::uint64_t seed) {
  Watched w(seed, 40);
  w.loop.multiply_noise(1, factor);
  const StageChange change = w.next_change();
  EXPECT_EQ(w.name(change), "noise of sensor 'y2'");
  EXPECT_LT(change.deviation, 0.25 * factor) << "too small to be tested";
  return (change.size - (factor - 1.0)) / change.deviation;
}

TEST(ModelTracker, NamesAndSizesMoreAndLessNoise) {
  EXPECT_LT(std::abs(error_of_noise_change(0.5, 3)), 4.0);
  double squares = 0.0;
  for (std::uint64_t seed = 3; seed < 8; ++seed)
    squares += std::pow(error_of_noise_change(3.0, seed), 2);
  // Chi-square with 5 degrees of freedom: above 15 in 1 of 100 cases.
  EXPECT_LT(squares, 15.0);
}

// Far from the model, where the derivatives of the first reference no longer apply.
TEST(ModelTracker, LearnsTheStageAgainAfterAChange) {
  Watched w(4, 40);
  w.become(move_second_mode);
  w.next_change();
  EXPECT_TRUE(w.watch(32).learning);
  EXPECT_FALSE(w.watch(30).learning);
  Eigen::VectorXd truth = Eigen::VectorXd::Zero(14);
  truth[1] = 0.06;
  expect_small(w.errors(truth));
  for (const double value : w.tracker.reference().chi_square) EXPECT_NEAR(value, 1.0, 0.5);
}

// The power of the motion is some hundred times that of the noise on the lines near two resonances.
TEST(ModelTracker, AMotionThatWasLearnedCausesNeitherAlarmsNorErrors) {
  Watched w(11);
  w.loop.move(10.0);
  w.watch(32 + 100);
  expect_small(w.errors());
  for (const double value : w.tracker.reference().chi_square) EXPECT_NEAR(value, 1.0, 0.5);
  // Not because nothing is seen any more.
  w.become([](StageProperties& stage) { stage.frequency_hz[2] *= 1.005; });
  EXPECT_EQ(w.name(w.next_change()), "frequency of the mode at 188 Hz");
}

TEST(ModelTracker, AMotionThatBeginsIsNamedAndLearned) {
  Watched w(12, 40);
  w.loop.move(10.0);
  EXPECT_EQ(w.next_change().what.kind, ChangeKind::motion);
  EXPECT_TRUE(w.watch(32).learning);
  EXPECT_FALSE(w.watch(60).learning);
  expect_small(w.errors());
}

TEST(ModelTracker, ADisturbancePassesWithoutAChange) {
  Watched w(4, 40);
  const Eigen::VectorXd before = w.tracker.estimate();
  const Eigen::VectorXd deviation = w.tracker.covariance().diagonal().cwiseSqrt();
  EXPECT_FALSE(w.tracker.add(w.loop.next(20.0)).change) << "it may still last";
  EXPECT_EQ(w.next_change().what.kind, ChangeKind::disturbance);
  EXPECT_EQ(w.tracker.estimate(), before);
  EXPECT_FALSE(w.watch(20).learning);
  // 20 of 60 periods are new: the estimates move by less than their deviations.
  EXPECT_LT((w.tracker.estimate() - before).cwiseQuotient(deviation).cwiseAbs().maxCoeff(), 3.0);
}

TEST(ModelTracker, AnotherExcitationIsLearnedAndTheEstimatesContinue) {
  Watched w(5, 50);
  const Eigen::VectorXd before = w.tracker.covariance().diagonal();
  w.tracker.change_excitation();
  w.loop.excite();
  const TrackedPeriod learning = w.watch(32);
  EXPECT_TRUE(learning.learning);
  EXPECT_FALSE(w.watch(30).learning);
  expect_small(w.errors());
  // With a memory of 100, the variance after n periods is proportional to (1 - e^(-2n/100)) / (1 - e^(-n/100))^2: 0.48
  // of that after 50 remain after 112. The excitations differ by a factor of two on some lines.
  const double kept = w.tracker.covariance().diagonal().cwiseQuotient(before).mean();
  EXPECT_GT(kept, 0.48 / 2.0);
  EXPECT_LT(kept, 0.48 * 1.6);
}

// The first excitation leaves the frequency uncertain, so that derivatives there do not suit the second one.
TEST(ModelTracker, AnExcitationThatShowsAModeCorrectsOneThatDoesNot) {
  constexpr int kRuns = 10;
  double squares = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    Watched w(300 + static_cast<std::uint64_t>(run));
    w.loop.excite_all_but(2);
    w.watch(34);
    w.tracker.change_excitation();
    w.loop.excite();
    w.watch(34);
    const Eigen::VectorXd ratio = w.errors();
    squares += (ratio[2] * ratio[2] + ratio[6] * ratio[6]) / (2 * kRuns);
  }
  // Frequency and damping ratio of the mode: 20 values, one deviation is 0.32. Without a new linearization it is 2.5.
  EXPECT_NEAR(squares, 1.0, 0.9);
}

TEST(ModelTracker, RefusesWhatItCannotTrack) {
  const auto refused = [](TrackerOptions options, const AdditiveModel& model,
                          const Eigen::VectorXd& lines_hz, const char* message) {
    EXPECT_THAT(
        test::error_message<std::invalid_argument>([&] { ModelTracker(model, lines_hz, options); }),
        testing::HasSubstr(message));
  };
  const AdditiveModel model = model_of({});
  const Eigen::VectorXd lines_hz = tracked_lines_hz();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused({}, model, lines_hz.head(1), "fewer than 2 lines");
  refused({}, model, {}, "fewer than 2 lines");
  refused({.learning_periods = 3}, model, lines_hz, "at least 4 periods");
  for (const double memory : {0.5, nan})
    refused({.memory_periods = memory}, model, lines_hz, "at least one period");
  for (const double rate : {0.0, -1e-3, 0.2, nan})
    refused({.false_alarms_per_period = rate}, model, lines_hz, "false alarms");
  AdditiveModel unsampled = model;
  unsampled.sample_rate_hz = 0.0;
  refused({}, unsampled, lines_hz, "sample rate");
  EXPECT_NO_THROW(ModelTracker(model, lines_hz.head(2), {.learning_periods = 4}));
}

}  // namespace stageid::test_model_tracker
