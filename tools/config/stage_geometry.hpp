#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace stageid {

/// Where a channel pushes or looks.
struct ChannelPlace {
  std::string name;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< from the centre of mass
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

struct StageGeometry {
  std::string stage;  ///< its name
  std::vector<ChannelPlace> actuators;
  std::vector<ChannelPlace> sensors;
  bool empty() const noexcept { return actuators.empty() && sensors.empty(); }
};

/// The places of the channels in the text of a stage file. `file` only names it in errors.
/// @throws FormatError "FILE:LINE:COLUMN: ..." if it is no stage file.
StageGeometry stage_geometry(const std::filesystem::path& file, const std::string& text);

}  // namespace stageid
