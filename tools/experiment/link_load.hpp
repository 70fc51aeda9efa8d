#pragma once

#include <string>
#include <vector>

#include "tools/config/stage_config.hpp"

namespace stageid {

/// What the wires of a stage have to carry when it is measured sample by sample.
struct LinkLoad {
  std::string link;      ///< interface or address
  double load = 0.0;     ///< of the time there is
  double cycle_s = 0.0;  ///< on the wire, a sample
  double most_hz = 0.0;  ///< the fastest stage that it would carry
};

/// One a bus; none for a stage that is simulated, replayed, or closes the loop by itself.
std::vector<LinkLoad> link_loads(const StageConfig& config);

/// One line: "can0: 62 % (124 us a sample; 3890 Hz at most)".
std::string to_string(const LinkLoad& load);

}  // namespace stageid
