// Is every planted fault found, and none on clean data?
//
//   health_study [plants = 100] [first seed = 1] [verbose = 0] [kind = all] [threads = all cores]
//
// For each random wafer stage and each kind of fault one log is made and examined, with the nominal
// configuration. Prints, per kind: logs, in how many the right cause was found at the right channel
// ("named"), with what largest error of its number (of a factor, relative; of a skew, us), in how many
// something else was found beside or instead of it ("others"), and how many logs there were not, since
// the loop did not hold with the fault ("unstable"). Exit code 1 unless every fault of every log was named
// and nothing else was.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "excitation/threads/worker_pool.hpp"
#include "frf/health/data_health.hpp"
#include "frf/plant/plant_frf.hpp"
#include "tests/benchmark/arguments.hpp"
#include "tests/support/logs/faulty_log.hpp"
#include "tests/support/logs/planted_faults.hpp"
#include "tests/support/stages/wafer_stage.hpp"
#include "tools/config/stage_expectation.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;

struct Tally {
  int logs = 0;
  int named = 0;
  int others = 0;
  int unstable = 0;
  double largest_error = 0.0;

  void add(const Tally& other) {
    logs += other.logs;
    named += other.named;
    others += other.others;
    unstable += other.unstable;
    largest_error = std::max(largest_error, other.largest_error);
  }
};

/// One plant with every kind of fault.
struct PlantResult {
  std::map<std::string, Tally> tallies;
  std::string text;
};

struct Study {
  SimulatedSpec nominal = wafer_stage_spec();
  std::optional<NominalStage> expectation = nominal_stage(nominal, nominal.plant);
  bool verbose = false;
  std::string only;

  PlantResult of_plant(int seed) const;
  std::string tell(const NamedFault& planted, int seed, const std::vector<Finding>& findings) const;
};

std::string Study::tell(const NamedFault& planted, int seed,
                        const std::vector<Finding>& findings) const {
  std::string text =
      fmt::format("plant {}, {} ({}):\n", seed, planted.name, planted.expected_channel);
  for (const Finding& f : findings)
    if (f.severity != Severity::unchecked || verbose)
      text += fmt::format("    {} | {} | {} | {} | {}\n", to_string(f.severity), f.channel, f.what,
                          f.figure, f.remedy);
  return text;
}

PlantResult Study::of_plant(int seed) const {
  PlantResult result;
  FaultyLogRequest request;
  request.configured = nominal;
  request.stage = random_wafer_stage(static_cast<std::uint64_t>(seed), nominal);
  request.seed = static_cast<std::uint64_t>(seed) + 1000;
  const MemoryLog clean = simulate_faulty_log(request, {});
  for (const NamedFault& planted : faults_to_plant(static_cast<std::uint64_t>(seed), clean)) {
    if (planted.name.find(only) == std::string::npos) continue;
    Tally& tally = result.tallies[planted.name];
    MemoryLog log;
    if (planted.in_recording) {
      log = clean;
      spoil_recording(planted.fault, log);
    } else {
      log = simulate_faulty_log(request, planted.fault);
    }
    if (log.log_runs.empty()) {
      ++tally.unstable;
      continue;
    }
    FrfOptions options;
    options.threads = 1;
    FrfAndHealth both = estimate_plant_frf_and_health({&log}, options);
    const auto findings = check_health(std::move(both.health), expectation);
    const Judgement judgement = judge(planted, findings, log.log_info);
    tally.add(
        {1, judgement.named ? 1 : 0, judgement.others > 0 ? 1 : 0, 0, std::abs(judgement.error)});
    if (verbose || !judgement.named || judgement.others > 0)
      result.text += tell(planted, seed, findings);
  }
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments argument(argc, argv);
  const int plants = argument(1, 100);
  const int first = argument(2, 1);
  Study study;
  study.verbose = argument(3, 0) != 0;
  study.only = argument.word(4, "");
  std::vector<PlantResult> results(plants);
  for_each_task(worker_count(argument(5, 0)), results.size(), [&](int, std::size_t i) {
    results[i] = study.of_plant(first + static_cast<int>(i));
  });
  std::map<std::string, Tally> tallies;
  for (const PlantResult& result : results) {
    fmt::print("{}", result.text);
    for (const auto& [name, tally] : result.tallies) tallies[name].add(tally);
  }
  bool all_right = true;
  fmt::print("{:28} {:>5} {:>6} {:>9} {:>7} {:>9}\n", "planted", "logs", "named", "error", "others",
             "unstable");
  for (const auto& [name, tally] : tallies) {
    fmt::print("{:28} {:5} {:6} {:9.2g} {:7} {:9}\n", name, tally.logs, tally.named,
               tally.largest_error, tally.others, tally.unstable);
    all_right = all_right && tally.named == tally.logs && tally.others == 0;
  }
  return all_right ? 0 : 1;
}
