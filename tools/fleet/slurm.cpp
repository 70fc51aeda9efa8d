#include "tools/fleet/slurm.hpp"

#include <fmt/format.h>

#include <cctype>
#include <sstream>
#include <vector>

#include "acquisition/files/fail.hpp"
#include "tools/terminal/external_program.hpp"
#include "tools/terminal/shell_word.hpp"

namespace stageid {

std::string submit_fleet(const FleetConfig& config, int tasks, int workers) {
  const std::string program = std::filesystem::read_symlink("/proc/self/exe").string();
  const std::string of_task = "${SLURM_CPUS_PER_TASK:-${SLURM_CPUS_ON_NODE:-1}}";
  // A task that is killed with its node is queued again; meanwhile others take over its jobs.
  std::vector<std::string> words = {"sbatch",
                                    "--parsable",
                                    "--job-name=stageid-fleet",
                                    fmt::format("--array=1-{}", tasks),
                                    "--requeue",
                                    "--open-mode=append",
                                    "--output=" + (config.results / "slurm-%A_%a.txt").string()};
  if (workers > 0) words.push_back(fmt::format("--cpus-per-task={}", workers));
  words.push_back(fmt::format("--wrap=exec {} --verbosity quiet fleet {} --workers {}",
                              shell_word(program), shell_word(config.file.string()),
                              workers > 0 ? fmt::format("{}", workers) : of_task));
  const ExternalEnd end = run_external(words, "", "slurm-client");
  const std::string first = end.messages.substr(0, end.messages.find('\n'));
  if (end.status != 0)
    fail_file(config.file, "not submitted: {}",
              first.empty() ? "sbatch failed without a message" : first);
  // NUMBER or NUMBER;CLUSTER, possibly after warnings.
  std::string number;
  std::istringstream lines(end.messages);
  for (std::string line; std::getline(lines, line);)
    if (!line.empty() && std::isdigit(static_cast<unsigned char>(line[0])) != 0)
      number = line.substr(0, line.find(';'));
  return number;
}

}  // namespace stageid
