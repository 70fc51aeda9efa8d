#include "hal/stage/plant_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <limits>
#include <stdexcept>
#include <vector>

#include "hal/stage/pacer.hpp"
#include "tests/hal/stage_bench.hpp"

namespace stageid::test_plant_watch {

using testing::HasSubstr;

constexpr std::int64_t kSecond_ns = 1'000'000'000;

PlantSnapshot good_snapshot() {
  PlantSnapshot snapshot;
  snapshot.t_ns = 10 * kSecond_ns;
  snapshot.interlock_closed = true;
  snapshot.state = NodeState::switch_on_disabled;
  snapshot.gravity_compensator_n = {50.0, 51.0};
  snapshot.temperature_k = {295.0};
  return snapshot;
}

PlantConditions conditions() { return {0.1, 40.0, 60.0, 285.0, 310.0, 0.2}; }

std::string trouble(const PlantSnapshot& snapshot, double age_s = 0.0) {
  return plant_trouble(snapshot, conditions(),
                       snapshot.t_ns + static_cast<std::int64_t>(age_s * 1e9));
}

TEST(PlantTrouble, EveryConditionIsNamed) {
  EXPECT_EQ(trouble(good_snapshot(), 0.09), "");
  EXPECT_THAT(trouble(good_snapshot(), 0.11), HasSubstr("the status is older than 0.1 s"));
  EXPECT_THAT(trouble({}), HasSubstr("no status has been read yet"));
  PlantSnapshot s = good_snapshot();
  s.interlock_closed = false;
  EXPECT_THAT(trouble(s), HasSubstr("the interlock is open"));
  s = good_snapshot();
  s.gravity_compensator_n[1] = 39.0;
  EXPECT_EQ(trouble(s), "gravity compensator 2: 39 N is out of range (40 to 60 N)");
  s.gravity_compensator_n[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(trouble(s), HasSubstr("gravity compensator 2: nan N"));
  s = good_snapshot();
  s.temperature_k[0] = 311.0;
  EXPECT_EQ(trouble(s), "temperature 1: 311 K is out of range (285 to 310 K)");
  s = good_snapshot();
  s.state = NodeState::fault;
  s.cause = FaultCause::watchdog;
  EXPECT_THAT(trouble(s), HasSubstr("the plant is in fault: the host stopped sending"));
}

/// A plant that obeys commands unless the test changes it.
class FakeSupervisor final : public Supervisor {
 public:
  PlantSnapshot snapshot() const override {
    const std::lock_guard lock(mutex_);
    PlantSnapshot snapshot = state_;
    if (alive_) snapshot.t_ns = monotonic_ns();
    return snapshot;
  }
  SupervisorReply request(SupervisorCommand command) override {
    const std::lock_guard lock(mutex_);
    requests_.push_back(command);
    if (!obedient_) return {false, "out of order"};
    state_.enabled = command == SupervisorCommand::enable && comes_up_;
    return {true, ""};
  }
  std::string trouble() const override { return alive_ ? "" : "the cable is cut"; }

  template <typename Change>
  void set(Change change) {
    const std::lock_guard lock(mutex_);
    change(*this);
  }
  std::vector<SupervisorCommand> requests() const {
    const std::lock_guard lock(mutex_);
    return requests_;
  }

  PlantSnapshot state_ = good_snapshot();
  std::atomic<bool> alive_ = true;
  bool obedient_ = true;
  bool comes_up_ = true;

 private:
  mutable std::mutex mutex_;
  std::vector<SupervisorCommand> requests_;
};

bool trips(const PlantWatch& watch) {
  return test::comes([&] { return watch.tripped().load(); });
}

TEST(PlantWatch, EnablesWatchesAndDisables) {
  FakeSupervisor supervisor;
  {
    const PlantWatch watch(supervisor, conditions());
    EXPECT_TRUE(supervisor.snapshot().enabled);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_FALSE(watch.tripped());
    EXPECT_EQ(watch.reason(), "");
  }
  EXPECT_EQ(supervisor.requests(), (std::vector<SupervisorCommand>{SupervisorCommand::enable,
                                                                   SupervisorCommand::disable}));
}

using Change = void (*)(FakeSupervisor&);

std::string reason_after(Change change) {
  FakeSupervisor supervisor;
  const PlantWatch watch(supervisor, conditions());
  supervisor.set(change);
  EXPECT_TRUE(trips(watch));
  return watch.reason();
}

TEST(PlantWatch, TripsWithTheReason) {
  EXPECT_THAT(reason_after([](auto& s) { s.state_.interlock_closed = false; }),
              HasSubstr("the interlock is open"));
  EXPECT_THAT(reason_after([](auto& s) { s.state_.temperature_k[0] = 400.0; }), HasSubstr("400 K"));
  EXPECT_THAT(reason_after([](auto& s) { s.state_.enabled = false; }), HasSubstr("not enabled"));
  EXPECT_THAT(reason_after([](auto& s) { s.alive_ = false; }),
              testing::AllOf(HasSubstr("the status is older"), HasSubstr("the cable is cut")));
}

TEST(PlantWatch, StaysTripped) {
  FakeSupervisor supervisor;
  const PlantWatch watch(supervisor, conditions());
  supervisor.set([](auto& s) { s.state_.interlock_closed = false; });
  ASSERT_TRUE(trips(watch));
  supervisor.set([](auto& s) { s.state_.interlock_closed = true; });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_TRUE(watch.tripped());
}

TEST(PlantWatch, DoesNotBringUpAPlantThatIsNotReady) {
  const auto watching = [](Change change) {
    return [change] {
      FakeSupervisor supervisor;
      change(supervisor);
      const PlantWatch watch(supervisor, conditions());
    };
  };
  const auto refused = [&](Change change, const char* text) {
    EXPECT_THAT(watching(change), testing::ThrowsMessage<StageError>(HasSubstr(text)));
  };
  EXPECT_NO_THROW(watching([](auto&) {})());
  refused([](auto& s) { s.state_.interlock_closed = false; }, "the interlock is open");
  refused([](auto& s) { s.alive_ = false; }, "the cable is cut");
  refused([](auto& s) { s.obedient_ = false; }, "the plant cannot be enabled: out of order");
  refused([](auto& s) { s.comes_up_ = false; }, "not enabled");
}

TEST(PlantWatch, ConditionsThatNothingFulfilsAreRefused) {
  FakeSupervisor supervisor;
  PlantConditions empty = conditions();
  empty.gravity_low_n = 61.0;
  EXPECT_THROW(PlantWatch(supervisor, empty), std::invalid_argument);
  empty = conditions();
  empty.stale_s = 0.0;
  EXPECT_THROW(PlantWatch(supervisor, empty), std::invalid_argument);
}

}  // namespace stageid::test_plant_watch
