#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace stageid {

/// Position and direction of a channel.
struct ChannelPlace {
  std::string name;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< from the centre of mass
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

struct StageGeometry {
  std::string stage;  ///< name of the stage
  std::vector<ChannelPlace> actuators;
  std::vector<ChannelPlace> sensors;
  bool empty() const noexcept { return actuators.empty() && sensors.empty(); }
};

/// The positions of the channels in the text of a stage file. `file` is used in errors only.
/// @throws FormatError "FILE:LINE:COLUMN: ..." if the text is not a stage file.
StageGeometry stage_geometry(const std::filesystem::path& file, const std::string& text);

}  // namespace stageid
