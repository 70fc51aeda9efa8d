#include "frf/runs/drive_mask.hpp"

#include "frf/runs/channel_choice.hpp"

namespace stageid {

DriveMask::DriveMask(const Eigen::MatrixXd& period, const LogInfo& info)
    : own_(info.actuators.size()) {
  const Eigen::Index samples = period.rows();
  if (samples == 0) return;
  const std::vector<Eigen::Index> actuators = actuators_of_excitation(info);
  any_.assign(samples, 0);
  for (Eigen::Index r = 0; r < period.cols(); ++r) {
    std::vector<char> changes(samples, 0);
    bool moves = false;
    for (Eigen::Index n = 0; n < samples; ++n) {
      if (period(n, r) == period(n > 0 ? n - 1 : samples - 1, r)) continue;
      changes[n] = any_[n] = 1;
      moves = true;
    }
    if (const Eigen::Index a = actuators[r]; moves && a >= 0) own_[a] = std::move(changes);
  }
}

const char* DriveMask::of_actuator(Eigen::Index actuator) const noexcept {
  return excites(actuator) ? own_[actuator].data() : any();
}

bool DriveMask::excites(Eigen::Index actuator) const noexcept {
  return static_cast<std::size_t>(actuator) < own_.size() && !own_[actuator].empty();
}

}  // namespace stageid
