#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/report/report.hpp"

namespace stageid {

/// What the head of the page says of the result.
struct Verdict {
  enum class Level : std::uint8_t {
    none,  ///< nothing to judge: a measurement without a model
    good,
    doubt,  ///< the reasons say why
    bad
  };
  Level level = Level::none;
  std::string text;
  std::vector<std::string> reasons;
};

const char* to_string(Verdict::Level level) noexcept;

/// Judges the model by how the fit ended, by held-back data, by the health of the runs, by the
/// truth where it is known (3 standard deviations and 1e-4) and by the messages.
Verdict judge(const ReportData& data);

}  // namespace stageid
