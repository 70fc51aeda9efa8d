#include "frf/timing_check.hpp"

#include "frf/excitation_timing.hpp"
#include "frf/repetition_check.hpp"

namespace stageid {

std::vector<Finding> check_timing(HealthRecord& record,
                                  const std::optional<NominalStage>& nominal) {
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
