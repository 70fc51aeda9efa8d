#include "tools/config/stage_geometry.hpp"

#include "tools/config/config_reader.hpp"
#include "tools/config/stage_keys.hpp"
#include "tools/config/strict_yaml.hpp"

namespace stageid {
namespace {

Eigen::Vector3d vector(const std::vector<double>& numbers) {
  return {numbers.at(0), numbers.at(1), numbers.at(2)};  // the keys require exactly three
}

std::vector<ChannelPlace> places(const std::vector<ChannelConfig>& channels) {
  std::vector<ChannelPlace> out;
  for (const ChannelConfig& c : channels)
    out.push_back({c.channel.name, vector(c.position_m), vector(c.direction)});
  return out;
}

}  // namespace

StageGeometry stage_geometry(const std::filesystem::path& file, const std::string& text) {
  StageFile stage;
  read_config(YamlDocument::parse(file, text),
              [&](ConfigVisitor& visitor) { describe_stage_file(visitor, stage); });
  return {stage.spec.info.name, places(stage.actuators), places(stage.sensors)};
}

}  // namespace stageid
