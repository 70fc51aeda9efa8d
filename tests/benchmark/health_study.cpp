// Is every planted fault found, and none on clean data?
//
//   health_study [plants = 100] [first seed = 1] [verbose = 0] [kind = all]
//
// For each random wafer stage and each kind of fault one log is made and examined, with the nominal
// configuration. Prints, per kind: logs, in how many the right cause was found at the right channel
// ("named"), with what error of its number, in how many something else was found beside or instead of
// it ("others"), and how many logs there were not, since the loop did not hold with the fault.

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "frf/data_health.hpp"
#include "tests/support/faulty_log.hpp"
#include "tests/support/planted_faults.hpp"
#include "tests/support/wafer_stage.hpp"
#include "tools/stage_expectation.hpp"

namespace {

using namespace stageid;
using stageid::test::MemoryLog;

struct Tally {
  int logs = 0;
  int named = 0;
  int others = 0;
  int unstable = 0;
};

}  // namespace

int main(int argc, char** argv) {
  const auto number = [&](int i, int otherwise) {
    return i < argc ? std::atoi(argv[i]) : otherwise;
  };
  const int plants = number(1, 100);
  const int first = number(2, 1);
  const bool verbose = number(3, 0) != 0;
  const std::string only = argc > 4 ? argv[4] : "";
  const WaferStageSpec nominal = test::wafer_stage_spec();
  const auto expectation = std::optional(nominal_stage(nominal));
  std::map<std::string, Tally> tallies;
  for (int seed = first; seed < first + plants; ++seed) {
    test::FaultyLogRequest request;
    request.configured = nominal;
    request.plant = test::random_wafer_stage(static_cast<std::uint64_t>(seed), nominal);
    request.seed = static_cast<std::uint64_t>(seed) + 1000;
    const MemoryLog clean = test::simulate_faulty_log(request, {});
    for (const test::NamedFault& planted :
         test::faults_to_plant(static_cast<std::uint64_t>(seed), clean)) {
      if (!only.empty() && planted.name.find(only) == std::string::npos) continue;
      Tally& tally = tallies[planted.name];
      MemoryLog log;
      if (planted.in_recording) {
        log = clean;
        test::spoil_recording(planted.fault, log);
      } else {
        log = test::simulate_faulty_log(request, planted.fault);
      }
      if (log.log_runs.empty()) {
        ++tally.unstable;
        continue;
      }
      ++tally.logs;
      const auto findings = check_health(read_health_record({&log}, {}), expectation);
      const test::Judgement judgement = test::judge(planted, findings, log.log_info);
      tally.named += judgement.named ? 1 : 0;
      tally.others += judgement.others > 0 ? 1 : 0;
      if (!verbose && judgement.named && judgement.others == 0) continue;
      fmt::print("plant {}, {} ({}):\n", seed, planted.name, planted.expected_channel);
      for (const Finding& f : findings)
        if (f.severity != Severity::unchecked || verbose)
          fmt::print("    {} | {} | {} | {} | {}\n", to_string(f.severity), f.channel, f.what,
                     f.figure, f.remedy);
    }
  }
  fmt::print("{:28} {:>5} {:>6} {:>7} {:>9}\n", "planted", "logs", "named", "others", "unstable");
  for (const auto& [name, tally] : tallies)
    fmt::print("{:28} {:5} {:6} {:7} {:9}\n", name, tally.logs, tally.named, tally.others,
               tally.unstable);
  return 0;
}
