#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "hal/stage/motion_controller.hpp"
#include "hal/stage/resident_stage.hpp"
#include "tests/support/stages/analytic_stage.hpp"

namespace stageid::test {

/// An analytic stage that closes the loop by itself, with scripted failures.
class PlayingStage final : public ResidentStage {
 public:
  PlayingStage(int actuators, int sensors)
      : plant_(actuators, sensors), controller_(analytic_controller(plant_.info())) {
    plant_.noise = 1e-3;
  }

  // The script.
  std::uint64_t polls = 1;            ///< until a run is over
  std::function<void()> at_poll;      ///< called in every poll
  std::uint64_t fails_at = 0;         ///< rows after which a run fails; 0: never
  Outcome failure = Outcome::fault;   ///< its outcome
  int loses_upload = -1;              ///< the upload of this run throws
  int loses_download = -1;            ///< the download of this run stops half-way
  Outcome odd_outcome = Outcome::ok;  ///< of row 7

  int stops = 0;
  std::vector<Trigger> triggers;

  const StageInfo& info() const noexcept override { return plant_.info(); }
  std::uint64_t depth_samples() const noexcept override { return depth; }
  std::uint64_t depth = 1000;

  JobProgress upload(const Waveforms& waveforms) override {
    if (static_cast<int>(triggers.size()) == loses_upload) throw StageError("the node fell silent");
    waveforms_ = waveforms;
    return {JobStatus::done, 0, 0, ""};
  }

  JobProgress arm(const Trigger& trigger) override {
    triggers.push_back(trigger);
    polled_ = 0;
    play(trigger.run_seed);
    return {JobStatus::running, 0, 0, ""};
  }

  JobProgress poll() override {
    if (at_poll) at_poll();
    if (++polled_ < polls) return {JobStatus::running, polled_, rows_, ""};
    if (fails_at == 0) return {JobStatus::done, rows_, rows_, ""};
    return {JobStatus::failed, rows_, rows_, "the stage says no", failure};
  }

  JobProgress download(const TraceSink& sink) override {
    const std::size_t columns = info().actuators.size() + info().sensors.size();
    const bool lost = static_cast<int>(triggers.size()) - 1 == loses_download;
    const std::size_t rows = lost ? rows_ / 2 : rows_;
    for (std::size_t row = 0; row < rows; row += 64) {
      const std::size_t count = std::min<std::size_t>(64, rows - row);
      std::vector<Outcome> outcomes(count, Outcome::ok);
      if (row == 0) outcomes[7] = odd_outcome;
      sink({trace_.data() + row * columns, count * columns}, outcomes);
    }
    if (lost) throw StageError("the node fell silent");
    return {JobStatus::done, 0, 0, ""};
  }

  void stop() noexcept override { ++stops; }

 private:
  void play(std::uint64_t run_seed) {
    std::vector<double> y(info().sensors.size());
    std::vector<double> u(info().actuators.size());
    Inputs inputs;
    inputs.y = y;
    controller_.reset();
    plant_.start(run_seed, inputs);
    trace_.clear();
    const Eigen::Index period = waveforms_.samples.rows();
    rows_ = static_cast<std::size_t>(period) *
            static_cast<std::size_t>(waveforms_.periods + waveforms_.transient_periods);
    if (fails_at > 0) rows_ = fails_at;
    for (std::size_t n = 0; n < rows_; ++n) {
      controller_.update(y.data(), u.data());
      for (std::size_t i = 0; i < u.size(); ++i)
        u[i] +=
            waveforms_.samples(static_cast<Eigen::Index>(n) % period, static_cast<Eigen::Index>(i));
      trace_.insert(trace_.end(), u.begin(), u.end());
      trace_.insert(trace_.end(), y.begin(), y.end());
      static_cast<void>(plant_.exchange({n, u}, inputs, {}));
    }
    plant_.stop();
  }

  AnalyticStage plant_;
  MotionController controller_;
  Waveforms waveforms_;
  std::vector<double> trace_;
  std::size_t rows_ = 0;
  std::uint64_t polled_ = 0;
};

}  // namespace stageid::test
