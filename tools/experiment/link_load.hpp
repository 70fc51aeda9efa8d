#pragma once

#include <string>
#include <vector>

#include "hal/can/can_bus_load.hpp"
#include "tools/config/stage_config.hpp"

namespace stageid {

/// One per bus; empty for a stage that is simulated, replayed, or closes the loop itself.
std::vector<LinkLoad> link_loads(const StageConfig& config);

/// One line: "can0: 62 % (124 us a sample; 3890 Hz at most)".
std::string to_string(const LinkLoad& load);

}  // namespace stageid
