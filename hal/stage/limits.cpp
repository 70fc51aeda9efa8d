#include "hal/stage/limits.hpp"

#include <cmath>

#include "excitation/words/require.hpp"

namespace stageid {
namespace {

void require_size(Eigen::Index size, std::size_t channels, const char* name) {
  require(size == static_cast<Eigen::Index>(channels), "limits: {} has {} entries for {} channels",
          name, size, channels);
}

Eigen::VectorXd positive_or(const Eigen::VectorXd& given, const Eigen::VectorXd& otherwise,
                            const char* name) {
  if (given.size() == 0) return otherwise;
  require_size(given.size(), static_cast<std::size_t>(otherwise.size()), name);
  for (Eigen::Index i = 0; i < given.size(); ++i)
    require(given[i] > 0.0, "limits: {}, entry {}: {} is not positive", name, i + 1, given[i]);
  return given;
}

void require_shape(const Eigen::MatrixXd& matrix, const std::vector<Channel>& rows,
                   const std::vector<Channel>& columns) {
  require_size(matrix.rows(), rows.size(), "motion");
  require_size(matrix.cols(), columns.size(), "motion");
}

void require_fits(const RigidMotion& motion, const StageInfo& info) {
  require_shape(motion.acceleration_per_n, info.sensors, info.actuators);
  require_shape(motion.force_per_acceleration, info.actuators, info.sensors);
  require(motion.bandwidth_rad_s > 0.0 && std::isfinite(motion.bandwidth_rad_s),
          "limits: the bandwidth of the motion must be positive");
  if (motion.contradiction.size() > 0)
    require_shape(motion.contradiction, info.sensors, info.sensors);
}

}  // namespace

StageLimits complete_limits(const StageLimits& limits, const StageInfo& info) {
  StageLimits all = limits;
  if (!limits.motion.known()) all.motion = {};
  Eigen::VectorXd none =
      Eigen::VectorXd::Constant(static_cast<Eigen::Index>(info.sensors.size()), kUnlimited);
  all.position_window_m = positive_or(limits.position_window_m, none, "position_window_m");
  const Eigen::VectorXd& window_m = all.position_window_m;
  all.hard_window_m = positive_or(limits.hard_window_m, 2.0 * window_m, "hard_window_m");
  all.deviation_m =
      limits.motion.known() ? positive_or(limits.deviation_m, 0.5 * window_m, "deviation_m") : none;
  all.speed_m_s = positive_or(limits.speed_m_s, none, "speed_m_s");
  for (Eigen::Index i = 0; i < window_m.size(); ++i)
    require(all.hard_window_m[i] >= window_m[i],
            "limits: hard_window_m, entry {}: {} is below window_m, {}", i + 1,
            all.hard_window_m[i], window_m[i]);
  const double repeats = limits.stuck_sensor_s * info.sample_rate_hz;
  require(repeats == 0.0 || (repeats >= 2.0 && repeats < 1e9),
          "limits: stuck_sensor_s is {} s at {} Hz; must be 0 or at least two samples",
          limits.stuck_sensor_s, info.sample_rate_hz);
  if (limits.motion.known()) require_fits(limits.motion, info);

  none.setConstant(static_cast<Eigen::Index>(info.actuators.size()), kUnlimited);
  all.actuator_n = positive_or(limits.actuator_n, none, "actuator_n");
  all.slew_n_s = positive_or(limits.slew_n_s, none, "slew_n_s");
  all.thermal_rms_n = positive_or(limits.thermal_rms_n, none, "thermal_rms_n");
  require(limits.thermal_time_constant_s > 0.0 && std::isfinite(limits.thermal_time_constant_s),
          "limits: thermal_time_constant_s must be positive; got {}",
          limits.thermal_time_constant_s);
  return all;
}

}  // namespace stageid
