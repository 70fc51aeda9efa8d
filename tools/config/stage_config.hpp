#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"
#include "hal/plugin/plugin_stage.hpp"
#include "hal/simulator/simulated_stage.hpp"
#include "hal/stage/real_time.hpp"
#include "hal/stage/stage_spec.hpp"
#include "tools/config/can_config.hpp"
#include "tools/config/config_visitor.hpp"
#include "tools/config/modbus_config.hpp"

namespace stageid {

enum class Backend : std::uint8_t { sim, can, modbus, plugin, replay };
template <>
inline constexpr std::array kWords<Backend> = {"sim", "can", "modbus", "plugin", "replay"};

/// The group `realtime` of a stage file.
struct RealTimeKeys {
  RealTimeOptions options;
  double jitter_s = 0.0;    ///< 0: tolerable_jitter_s()
  int misses_allowed = 10;  ///< see LoopOptions
};

/// Content of a stage file, and the stage derived from it.
struct StageConfig {
  std::filesystem::path file;
  std::string text;             ///< of the file, kept for the log
  std::string controller_text;  ///< of the controller in another file; empty: none
  Backend backend = Backend::sim;
  RealTimeKeys real_time;
  double ramp_s = 0.1;  ///< of a stop, see LoopOptions
  BetweenRuns between_runs = BetweenRuns::release;
  StageSpec spec;                  ///< complete: limits, controller from the geometry
  std::optional<PlantSpec> plant;  ///< of the simulation, or for predictions
  SimulationSpec simulation;
  double pace = 0.0;  ///< 0: virtual time; 1: wall clock
  CanConfig can;
  std::optional<ModbusConfig> modbus;          ///< of the stage
  std::optional<PluginSpec> plugin;            ///< a third-party back end
  std::optional<SupervisorConfig> supervisor;  ///< of the plant around it
};

/// Reads a stage file and checks it up to a stage that could be started.
/// @throws FileError, FormatError "FILE:LINE:COLUMN: problem; remedy".
StageConfig load_stage_config(const std::filesystem::path& file);

/// The same from texts, as stored in a log; `name` is used in errors only. @throws FormatError
StageConfig parse_stage_config(const std::filesystem::path& name, std::string text,
                               std::string controller_text);

/// Name, sample rate and channels in the text of a stage file; `name` is used in errors only. @throws FormatError
StageInfo stage_info(const std::filesystem::path& name, std::string text);

/// The keys of a stage file. Used by `stageid config schema`.
void describe_stage_keys(ConfigVisitor& visitor);

/// The modes that can appear in the identified sub-plant: out-of-plane and flexible ones, observed by at least one of
/// `sensors` and driven by at least one of `actuators` (names).
std::vector<PlantMode> flexible_modes_seen(const StageInfo& info, const PlantSpec& plant,
                                           const std::vector<std::string>& actuators,
                                           const std::vector<std::string>& sensors);

}  // namespace stageid
