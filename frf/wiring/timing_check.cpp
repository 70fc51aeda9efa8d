#include "frf/wiring/timing_check.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <utility>

#include "frf/wiring/excitation_timing.hpp"
#include "frf/wiring/repetition_check.hpp"

namespace stageid {
namespace {

constexpr int kShort = 4;  // in samples; a recorder may repeatedly lose this number

/// Equal long gaps in one run: the declared period differs from that of the records.
std::optional<Finding> wrong_period(const HealthRecord& record) {
  for (std::size_t i = 0; i < record.slips.size(); ++i)
    for (std::size_t k = i + 1; k < record.slips.size(); ++k) {
      const SampleSlip& one = record.slips[i];
      const SampleSlip& other = record.slips[k];
      if (one.run != other.run || one.lost != other.lost || std::abs(one.lost) <= kShort) continue;
      return Finding{
          Severity::fault,
          Cause::aperiodic,
          "",
          "the records are shifted repeatedly: period_samples does not match their period",
          fmt::format("by {} samples in run {}, period of {} samples", one.lost, one.run,
                      record.info.period_samples),
          "correct period_samples and the excitation of the log"};
    }
  return std::nullopt;
}

}  // namespace

std::vector<Finding> check_timing(HealthRecord& record,
                                  const std::optional<NominalStage>& nominal) {
  if (std::optional<Finding> wrong = wrong_period(record)) return {std::move(*wrong)};
  std::vector<Finding> findings;
  for (const SampleSlip& slip : record.slips) findings.push_back(to_finding(slip));
  const std::vector<Finding> aperiodic = check_repetition(record);
  findings.insert(findings.end(), aperiodic.begin(), aperiodic.end());
  if (!aperiodic.empty()) return findings;
  const std::optional<ExcitationDelay> delay = align_excitation(record, nominal);
  if (delay) findings.push_back(to_finding(*delay));
  if (record.drift) findings.push_back(to_finding(*record.drift));
  return findings;
}

}  // namespace stageid
