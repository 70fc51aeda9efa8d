#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "excitation/words/words.hpp"
#include "tools/report/report_page.hpp"
#include "tools/steps/problem.hpp"
#include "tools/terminal/json.hpp"

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
  std::vector<Problem> problems;     ///< those of judge_model(), see rank()
  std::vector<std::string> remarks;  ///< further reasons to look closer
};
template <>
inline constexpr std::array kWords<Verdict::Level> = {"none", "good", "doubt", "bad"};

/// Bad: judge_model() does not trust the model, or without a model the data have a fault. Remarks are incomplete runs,
/// the truth if known (3 standard deviations and 1e-4) and the doubts of the job that no problem contains.
Verdict judge(const ReportData& data);
Json verdict_json(const Verdict& verdict);

}  // namespace stageid
