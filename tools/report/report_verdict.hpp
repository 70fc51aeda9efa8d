#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"
#include "tools/report/report_page.hpp"

namespace stageid {

/// The verdict in the head of the page.
struct Verdict {
  enum class Level : std::uint8_t {
    none,  ///< nothing to judge: a measurement without a model
    good,
    doubt,  ///< see the reasons
    bad
  };
  Level level = Level::none;
  std::string text;
  std::vector<std::string> reasons;
};
template <>
inline constexpr std::array kWords<Verdict::Level> = {"none", "good", "doubt", "bad"};

/// Bad: judge_model() does not trust the model, or without a model the data have a fault. Doubts are the other reasons of
/// judge_model(), incomplete runs, the truth if known (3 standard deviations and 1e-4) and the doubts of the job.
Verdict judge(const ReportData& data);

}  // namespace stageid
