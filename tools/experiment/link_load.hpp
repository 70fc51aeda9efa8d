#pragma once

#include <string>
#include <vector>

#include "tools/config/stage_config.hpp"

namespace stageid {

/// Load of a connection of a stage that is measured sample by sample.
struct LinkLoad {
  std::string link;      ///< interface or address
  double load = 0.0;     ///< share of the available time
  double cycle_s = 0.0;  ///< on the wire, per sample
  double most_hz = 0.0;  ///< the highest sample rate that it could carry
};

/// One per bus; empty for a stage that is simulated, replayed, or closes the loop itself.
std::vector<LinkLoad> link_loads(const StageConfig& config);

/// One line: "can0: 62 % (124 us a sample; 3890 Hz at most)".
std::string to_string(const LinkLoad& load);

}  // namespace stageid
