#include <nlohmann/json.hpp>

#include "acquisition/files/output_file.hpp"
#include "estimation/file/json_file.hpp"
#include "estimation/model/cmif.hpp"

namespace stageid {

void write_modes(const std::filesystem::path& file, const std::vector<ModeCandidate>& modes) {
  nlohmann::ordered_json root;
  root["format"] = "stageid-modes";
  root["modes"] = nlohmann::ordered_json::array();
  for (const ModeCandidate& mode : modes)
    root["modes"].push_back({{"frequency_hz", mode.frequency_hz},
                             {"damping_ratio", mode.damping_ratio},
                             {"cmif_curve", mode.cmif_curve}});
  write_text_file(file, root.dump(2) + "\n");
}

std::vector<ModeCandidate> read_modes(const std::filesystem::path& file) {
  const JsonFile json(file, "stageid-modes");
  std::vector<ModeCandidate> modes;
  for (const JsonNode& node : json.root().member("modes").elements()) {
    ModeCandidate mode;
    mode.frequency_hz = node.member("frequency_hz").positive();
    mode.damping_ratio = node.has("damping_ratio") ? node.member("damping_ratio").positive() : 0.01;
    mode.cmif_curve =
        node.has("cmif_curve") ? static_cast<int>(node.member("cmif_curve").integer(1, 1000)) : 1;
    if (mode.damping_ratio >= 1.0)
      node.member("damping_ratio").fail("must be below 1 (1 is critical damping)");
    modes.push_back(mode);
  }
  return modes;
}

}  // namespace stageid
