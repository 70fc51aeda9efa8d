#include "hal/stage/replay_stage.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "excitation/words/require.hpp"

namespace stageid {

ReplayStage::ReplayStage(StageInfo info, std::unique_ptr<ReplaySource> source, double tolerance_n)
    : info_(std::move(info)), source_(std::move(source)), tolerance_n_(tolerance_n) {
  require(source_ != nullptr, "replay: a source is required");
  require(tolerance_n >= 0.0 && std::isfinite(tolerance_n),
          "replay: the tolerance must be 0 or more; got {}", tolerance_n);
  require(!info_.sensors.empty() && info_.sensors.size() <= 64,
          "replay: {} sensors are unsupported; must be 1 to 64", info_.sensors.size());
  require(info_.sample_rate_hz > 0.0, "replay: the sample rate must be positive");
}

void ReplayStage::start(std::uint64_t /*run_seed*/, Inputs& first) {
  const int run = run_ + 1;
  require<StageError>(
      run < source_->runs(),
      "replay: run {} is out of range; the log has {}. Record a longer log or replay fewer runs",
      run + 1, source_->runs());
  source_->load(run, u_, y_, marked_);
  const Eigen::Index samples = u_.cols();
  require<StageError>(
      u_.rows() == static_cast<Eigen::Index>(info_.actuators.size()) &&
          y_.rows() == static_cast<Eigen::Index>(info_.sensors.size()) && y_.cols() == samples &&
          samples != 0 && (marked_.size() == 0 || marked_.size() == samples),
      "replay: run {} has u {} x {}, y {} x {} and {} marks; expected {} actuators, {} sensors and "
      "equal numbers of samples",
      run + 1, u_.rows(), samples, y_.rows(), y_.cols(), marked_.size(), info_.actuators.size(),
      info_.sensors.size());
  require(first.y.size() == info_.sensors.size(),
          "replay: Inputs::y must have one entry per sensor");
  run_ = run;
  cycle_ = 0;
  give(first, 0);
  if (marked_.size() != 0 && marked_[0] != 0) first.valid = 0;
}

void ReplayStage::give(Inputs& inputs, Eigen::Index sample) const noexcept {
  const auto sensors = static_cast<Eigen::Index>(inputs.y.size());
  std::copy_n(y_.col(sample).data(), sensors, inputs.y.begin());
  inputs.cycle = cycle_;
  inputs.t_sample_ns =
      static_cast<std::int64_t>(1e9 * static_cast<double>(cycle_) / info_.sample_rate_hz);
  inputs.t_rx_ns = inputs.t_sample_ns;
  inputs.valid = all_bits(inputs.y.size());
  inputs.node_state = NodeState::operation_enabled;
}

void ReplayStage::compare(const Outputs& outputs) noexcept {
  for (Eigen::Index i = 0; i < u_.rows(); ++i) {
    const double difference = std::abs(outputs.u[i] - u_(i, cycle_));
    if (!(difference <= tolerance_n_)) ++mismatches_;  // NaN is a mismatch too
    largest_mismatch_n_ = std::max(largest_mismatch_n_, difference);
  }
}

Outcome ReplayStage::exchange(const Outputs& outputs, Inputs& inputs,
                              Deadline /*deadline*/) noexcept {
  const auto samples = static_cast<std::uint64_t>(u_.cols());
  if (cycle_ >= samples || outputs.u.size() != static_cast<std::size_t>(u_.rows()) ||
      inputs.y.size() != static_cast<std::size_t>(y_.rows())) {
    inputs.valid = 0;
    return Outcome::link_down;
  }
  compare(outputs);
  ++cycle_;
  const auto next = static_cast<Eigen::Index>(std::min(cycle_, samples - 1));
  give(inputs, next);
  const bool marked = marked_.size() != 0 && cycle_ < samples && marked_[next] != 0;
  return marked ? Outcome::late : Outcome::ok;
}

void ReplayStage::stop() noexcept { u_.resize(u_.rows(), 0); }

}  // namespace stageid
