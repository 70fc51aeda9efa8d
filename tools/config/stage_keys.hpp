#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "hal/simulator/rigid_body.hpp"
#include "tools/config/controller_keys.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid {

struct ChannelConfig {
  Channel channel;
  double limit_n = kUnlimited;
  double slew_n_s = kUnlimited;
  double thermal_rms_n = kUnlimited;
  double bias_n = 0.0;
  double window_m = kUnlimited;
  double hard_window_m = 0.0;  // 0: derived
  double deviation_m = 0.0;    // 0: derived
  double speed_m_s = kUnlimited;
};

struct InPlaneModeConfig {
  double natural_frequency_hz = 0.0;
  double damping_ratio = 0.0;
  std::vector<std::pair<std::string, double>> actuators;
  std::vector<std::pair<std::string, double>> sensors;
};

struct FaultConfig {
  SimulationSpec::Fault fault;
  std::string channel;
};

/// Content of the file, key by key.
struct StageFile {
  std::size_t format = 0;
  double thermal_time_constant_s = 10.0;
  std::vector<ChannelConfig> actuators;
  std::vector<ChannelConfig> sensors;
  std::vector<double> inertia_kg_m2;
  std::vector<double> suspension_hz;
  std::vector<InPlaneModeConfig> in_plane_modes;
  std::array<AxisController, kRigidAxes> axes;
  LinearControllerKeys linear;
  std::string controller;  // peer or a file; empty: in this file
  std::vector<FaultConfig> faults;
  CanFile can;
  StageConfig config;  // without what is derived from the keys above
};

/// Describes the keys of a stage file.
void describe_stage_file(ConfigVisitor& v, StageFile& f);

}  // namespace stageid
