// Ownership of the stage: second hosts, second nodes, forged frames and garbage on a bus.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <deque>
#include <random>
#include <string>
#include <vector>

#include "hal/can/can_resident_stage.hpp"
#include "tests/hal/can/can_host.hpp"
#include "tests/hal/stage_bench.hpp"
#include "tests/support/process/resident_bytes.hpp"

namespace stageid::test_can_ownership {

using test::CanRig;
using Host = test::CanHost;
using Running = test::RunningCanHost;
using test::refuses;
using testing::HasSubstr;

TEST(CanOwnership, ASecondHostIsRefusedAndTheFirstNoticesNothing) {
  const std::vector<double> y = test::undisturbed_can_run(200);
  CanRig rig;
  Host first(rig);
  Host second(rig);
  first.start();
  for (std::size_t n = 0; n < y.size(); ++n) {
    if (n == 50) {
      EXPECT_THAT([&] { second.start(); },
                  refuses("another host measures with this stage; wait until it has ended"));
    }
    if (n == 100) second.stage().stop();
    ASSERT_EQ(first.exchange(), Outcome::ok) << n << first.stage().trouble();
    ASSERT_EQ(first.y()[0], y[n]) << n;
  }
  EXPECT_EQ(first.stage().counts().repeats, 0U);
  first.stage().stop();
  EXPECT_EQ(rig.node().state(), NodeState::switch_on_disabled);
  second.start();
  EXPECT_EQ(second.exchange(), Outcome::ok);
}

/// Frames with a correct checksum and a wrong key, as from a host that guesses.
class Forger {
 public:
  explicit Forger(CanRig& rig) : rig_(rig) {}

  void send(std::uint16_t next, std::uint8_t run) {
    using Code = CanCommandCode;
    constexpr Code kCodes[] = {Code::hello,       Code::start,  Code::stop,
                               Code::reset_fault, Code::arm,    Code::trigger,
                               Code::missing,     Code::upload, Code::download};
    CanCommand command{kCodes[engine_() % std::size(kCodes)]};
    command.sequence = static_cast<std::uint16_t>(engine_());
    command.host = static_cast<std::uint32_t>(engine_()) | 1U;
    command.session = static_cast<std::uint32_t>(engine_());
    command.c = 1;
    command.a = 1;
    rig_.send_to_node(encode_can_command(command));
    // The run number is right, because it can be read on the bus; the rest of the key is wrong.
    CanFrame setpoint;
    const std::vector<double> u(2, 49.0);
    for (const std::uint8_t guess : {run, static_cast<std::uint8_t>(run + 1)}) {
      CanHeader header{next, 0, guess, tag_};
      encode_can_values(rig_.layout().setpoints[0], rig_.layout().actuator_scale, u, header,
                        setpoint);
      rig_.send_to_node(setpoint);
    }
    const std::vector<double> y(1, 1e-3);
    CanFrame measurement;
    encode_can_values(rig_.layout().sensors[0], rig_.layout().sensor_scale, y,
                      {next, 5, static_cast<std::uint8_t>(run + 1), 0}, measurement);
    rig_.send_to_host(measurement);
  }
  /// Another tag than that of the run.
  void avoid(std::uint16_t tag) { tag_ = static_cast<std::uint16_t>(tag + 1); }

 private:
  CanRig& rig_;
  std::mt19937 engine_{7};
  std::uint16_t tag_ = 0;
};

TEST(CanOwnership, TenThousandForgedFramesChangeNoSample) {
  constexpr int kSamples = 2500;  // four frames each
  const std::vector<double> y = test::undisturbed_can_run(kSamples);
  CanRig rig;
  Running host(rig);
  const std::uint32_t session = rig.node().session();
  Forger forger(rig);
  forger.avoid(can_tag(session));
  for (std::size_t n = 0; n < y.size(); ++n) {
    forger.send(static_cast<std::uint16_t>(n + 1), can_run(session));
    ASSERT_EQ(host.exchange(), Outcome::ok) << n << host.stage().trouble();
    ASSERT_EQ(host.y()[0], y[n]) << n;
  }
  EXPECT_EQ(rig.node().sample(), y.size());
  host.stage().stop();
  EXPECT_EQ(host.stage().node().gaps, 0U);
  EXPECT_EQ(host.stage().node().repeated, 0U);
  EXPECT_EQ(rig.node().state(), NodeState::switch_on_disabled);
}

TEST(CanOwnership, AHundredThousandRandomFramesChangeNoSample) {
  constexpr int kSamples = 1000;
  const std::vector<double> y = test::undisturbed_can_run(kSamples);
  CanRig rig;
  Running host(rig);
  std::mt19937_64 engine(3);
  const std::size_t before = test::resident_bytes();
  for (std::size_t n = 0; n < y.size(); ++n) {
    for (int i = 0; i < 50; ++i) {
      CanFrame frame;
      for (std::size_t at = 0; at < 64; at += 8) put_can(frame, at, engine());
      constexpr std::uint16_t kIds[] = {kCanCommandId, kCanSetpointId, kCanUploadId, kCanStateId,
                                        kCanSensorId,  kCanTextId,     0x7FF,        kCanMissingId};
      frame.id = kIds[engine() % 8];
      frame.length = static_cast<std::uint8_t>(can_fd_length(engine() % 65));
      rig.send_to_node(frame);
      rig.send_to_host(frame);
    }
    ASSERT_EQ(host.exchange(), Outcome::ok) << n << host.stage().trouble();
    ASSERT_EQ(host.y()[0], y[n]) << n;
  }
  EXPECT_EQ(rig.front().rejected(), 50U * y.size());
  EXPECT_LT(test::resident_bytes() - before, std::size_t{1} << 20);
}

TEST(CanOwnership, AnybodyMayAskForAQuickStop) {
  CanRig rig;
  Running host(rig);
  rig.send_to_node(encode_can_command({.code = CanCommandCode::quick_stop, .host = 1}));
  rig.serve_ms(1);
  EXPECT_EQ(rig.node().state(), NodeState::quick_stop);
  EXPECT_EQ(host.exchange(), Outcome::fault);
}

TEST(CanOwnership, AHostOfVersionOneIsToldToBeUpdated) {
  CanRig rig;
  CanFrame frame;  // 24 bytes after the header, as in version 1
  frame.id = kCanCommandId;
  seal_can_frame(frame, {7, static_cast<std::uint8_t>(CanCommandCode::start), 1, 0}, 24);
  rig.send_to_node(frame);
  rig.serve_ms(1);
  std::vector<CanFrame> said(64);
  said.resize(rig.pair().host().receive(said));
  std::string text;
  CanState answer;
  for (const CanFrame& one : said) {
    std::size_t part = 0;
    std::string piece;
    CanState state;
    if (decode_can_text(one, part, piece)) text += piece;
    if (decode_can_state(one, state) && state.sequence == 7) answer = state;
  }
  EXPECT_EQ(answer.answer, CanAnswer::refused);
  EXPECT_EQ(answer.version, 2);
  EXPECT_THAT(text, HasSubstr("a different protocol version (2; expected 1)"));
  EXPECT_EQ(rig.node().state(), NodeState::switch_on_disabled);
}

/// Several nodes at one end of a bus; each receives every frame.
class Hub {
 public:
  explicit Hub(CanTransport& bus) : bus_(bus) {}

  class End final : public CanThrough {
   public:
    explicit End(Hub& hub) : CanThrough(hub.bus_) {}
    std::size_t receive(std::span<CanFrame> frames) noexcept override {
      std::size_t count = 0;
      for (; count < frames.size() && !queue.empty(); queue.pop_front())
        frames[count++] = queue.front();
      return count;
    }
    void wait(std::int64_t) noexcept override {}
    std::deque<CanFrame> queue;
  };

  void pump() {
    std::vector<CanFrame> frames(64);
    frames.resize(bus_.receive(frames));
    for (End* end : ends) end->queue.insert(end->queue.end(), frames.begin(), frames.end());
  }
  std::vector<End*> ends;

 private:
  CanTransport& bus_;
};

/// A second node with its own stage, using the same identifiers.
struct Twin {
  Twin(CanRig& rig, Hub& hub) : end(hub), stage(rig.new_node()), front(stage, rig.layout(), end) {}
  Hub::End end;
  StageNode stage;
  CanNode front;
};

TEST(CanOwnership, TwoNodesWithOneIdentifierAreRefused) {
  CanRig rig;
  Hub hub(rig.pair().node());
  Twin a(rig, hub);
  Twin b(rig, hub);
  hub.ends = {&a.end, &b.end};
  rig.pair().when_host_waits([&] {
    hub.pump();
    a.front.serve(0);
    b.front.serve(0);
  });
  Host host(rig);
  EXPECT_THAT([&] { host.start(); }, refuses("two nodes answer"));
  EXPECT_EQ(a.stage.state(), NodeState::switch_on_disabled);
  EXPECT_EQ(b.stage.state(), NodeState::switch_on_disabled);
}

TEST(CanOwnership, ANodeThatJoinsARunEndsIt) {
  CanRig rig;
  Hub hub(rig.pair().node());
  Twin a(rig, hub);
  Twin b(rig, hub);
  hub.ends = {&a.end};
  bool both = false;
  rig.pair().when_host_waits([&] {
    hub.pump();
    a.front.serve(0);
    if (both) b.front.serve(0);
  });
  Running host(rig);
  EXPECT_THAT(host.exchange(20), testing::ElementsAreArray(test::all_ok(20)));
  hub.ends.push_back(&b.end);
  both = true;
  Outcome outcome = Outcome::ok;
  for (int n = 0; n < 5 && outcome == Outcome::ok; ++n) outcome = host.exchange();
  EXPECT_EQ(outcome, Outcome::fault);
  EXPECT_THAT(host.stage().trouble(), HasSubstr("or a second node answers instead"));
  EXPECT_EQ(b.stage.sample(), 0U) << "the second stage moved";
}

Waveforms waveforms(int periods) {
  Waveforms w;
  w.samples.setZero(100, 2);
  w.samples(3, 1) = 0.5;
  w.periods = periods;
  return w;
}

void no_rows(std::span<const double>, std::span<const Outcome>) {}

TEST(CanOwnership, AResidentRunBelongsToWhoArmedIt) {
  CanRig rig;
  const auto first = rig.resident();
  const auto second = rig.resident();
  first->upload(waveforms(20000));
  first->arm({});
  ASSERT_EQ(rig.node().state(), NodeState::measuring);
  const std::string held = "another host measures with this stage";
  EXPECT_THAT([&] { second->upload(waveforms(1)); }, refuses(held));
  EXPECT_THAT([&] { second->arm({}); }, refuses(held));
  second->stop();
  Host streaming(rig);
  EXPECT_THAT([&] { streaming.start(); }, refuses(held));
  EXPECT_EQ(rig.node().state(), NodeState::measuring);
  EXPECT_EQ(first->poll().status, JobStatus::running);
  first->stop();
  EXPECT_EQ(rig.node().state(), NodeState::quick_stop);
  EXPECT_THAT([&] { second->download(no_rows); }, refuses("belongs to another host"));
  EXPECT_NO_THROW(first->download(no_rows));
}

// Otherwise another host's arm would overwrite a trace that its owner has not downloaded yet.
TEST(CanOwnership, AStageStaysReservedBetweenTheRunsOfAResidentExperiment) {
  CanRig rig;
  const auto first = rig.resident();
  const auto second = rig.resident();
  first->upload(waveforms(1));
  first->arm({});
  rig.serve_ms(100);
  ASSERT_EQ(first->poll().status, JobStatus::done);
  const std::string held = "another host measures with this stage";
  EXPECT_THAT([&] { second->upload(waveforms(1)); }, refuses(held));
  Host streaming(rig);
  EXPECT_THAT([&] { streaming.start(); }, refuses(held));
  EXPECT_EQ(first->download(no_rows).done, 100U);
  first->upload(waveforms(2));
  first->arm({});
  rig.serve_ms(100);
  EXPECT_EQ(first->poll().status, JobStatus::done);
  first->stop();
  second->upload(waveforms(1));
  second->arm({});
  rig.serve_ms(100);
  EXPECT_EQ(second->poll().status, JobStatus::done);
  rig.serve_ms(1100);  // without a stop
  EXPECT_EQ(rig.node().session(), 0U);
  streaming.start();
  EXPECT_EQ(streaming.exchange(), Outcome::ok);
}

TEST(CanOwnership, OthersDoNotKeepASilentHostsRunAlive) {
  CanRig rig;
  const auto first = rig.resident();
  const auto second = rig.resident();
  first->upload(waveforms(20000));
  first->arm({});
  for (int i = 0; i < 11; ++i) {
    second->connect();
    EXPECT_THROW(second->arm({}), StageError);
    rig.serve_ms(100);
  }
  EXPECT_EQ(rig.node().cause(), FaultCause::watchdog);
}

TEST(CanOwnership, AnArmedNodeWhoseHostFallsSilentIsFreeAgain) {
  CanRig rig;
  const auto first = rig.resident();
  first->upload(waveforms(1));
  CanCommand arm{CanCommandCode::arm};  // the trigger never comes
  arm.host = 5;
  arm.b = 100;
  std::vector<std::uint8_t> bytes(400);  // of the one excited actuator
  const float half = 0.5F;
  std::memcpy(bytes.data() + 12, &half, sizeof half);
  arm.d = static_cast<std::uint32_t>(can_digest(bytes));
  const CanFrame frame = encode_can_command(arm);
  rig.send_to_node(frame);
  rig.serve_ms(1);
  ASSERT_NE(rig.node().session(), 0U);
  // A chunk received now must not change the waveform whose digest was checked.
  const std::uint32_t rejected = rig.front().rejected();
  for (int token = 0; token < 256; ++token) {
    rig.send_to_node(encode_can_chunk(
        kCanUploadId, {0, static_cast<std::uint8_t>(token), std::span(bytes).first(56)}));
  }
  rig.serve_ms(5);
  EXPECT_EQ(rig.front().rejected(), rejected + 256);
  Host host(rig);
  EXPECT_THAT([&] { host.start(); }, refuses("another host measures"));
  rig.serve_ms(1100);
  EXPECT_EQ(rig.node().session(), 0U);
  EXPECT_EQ(rig.node().state(), NodeState::switch_on_disabled);
  host.start();
  EXPECT_EQ(host.exchange(), Outcome::ok);
}

}  // namespace stageid::test_can_ownership
