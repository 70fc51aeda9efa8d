#include "hal/stage/real_time_checks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <string_view>
#include <system_error>

namespace stageid {
namespace {

namespace fs = std::filesystem;

constexpr int kLongestWake_us = 10;

std::string first_line(const fs::path& file) {
  std::string line;
  std::ifstream stream(file);
  std::getline(stream, line);
  return line;
}

int number(std::string_view text, int otherwise) {
  int value = otherwise;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// Whether a list of the kernel, "0-2,5", contains the processor.
bool lists(std::string_view list, int cpu) {
  while (!list.empty()) {
    const std::string_view part = list.substr(0, list.find(','));
    list.remove_prefix(std::min(list.size(), part.size() + 1));
    const int first = number(part, -1);
    const std::size_t dash = part.find('-');
    const int last = dash == std::string_view::npos ? first : number(part.substr(dash + 1), -1);
    if (first >= 0 && first <= cpu && cpu <= last) return true;
  }
  return false;
}

/// Entries of a directory, sorted; empty if it does not exist.
std::vector<fs::path> entries(const fs::path& directory) {
  std::vector<fs::path> found;
  std::error_code none;
  for (fs::directory_iterator at(directory, none), end; !none && at != end; at.increment(none))
    found.push_back(at->path());
  std::sort(found.begin(), found.end());
  return found;
}

/// Directories cpu0, cpu1, ... of the processors on which the loop can be.
std::vector<fs::path> processors(int cpu, const fs::path& root) {
  std::vector<fs::path> found;
  for (const fs::path& entry : entries(root / "sys/devices/system/cpu")) {
    const std::string name = entry.filename();
    const int index = name.starts_with("cpu") ? number(std::string_view(name).substr(3), -1) : -1;
    if (index >= 0 && (cpu < 0 || index == cpu)) found.push_back(entry);
  }
  return found;
}

std::string governor_of(const fs::path& processor) {
  const std::string governor = first_line(processor / "cpufreq/scaling_governor");
  if (governor.empty() || governor == "performance") return "";
  return fmt::format(
      "the frequency governor of {} is '{}', so its speed changes during the run; run 'cpupower "
      "frequency-set -g performance'",
      processor.filename().string(), governor);
}

std::string idle_states_of(const fs::path& processor) {
  int longest_us = 0;
  for (const fs::path& state : entries(processor / "cpuidle"))
    if (first_line(state / "disable") != "1")
      longest_us = std::max(longest_us, number(first_line(state / "latency"), 0));
  if (longest_us <= kLongestWake_us) return "";
  return fmt::format(
      "{} needs up to {} us to leave its deepest idle state; run 'cpupower idle-set -D {}', or "
      "boot with processor.max_cstate=1",
      processor.filename().string(), longest_us, kLongestWake_us);
}

std::string isolation_of(int cpu, const fs::path& root) {
  const fs::path file = root / "sys/devices/system/cpu/isolated";
  std::error_code none;
  if (!fs::exists(file, none) || lists(first_line(file), cpu)) return "";
  return fmt::format(
      "other programs may use processor {}; boot with isolcpus={} nohz_full={}, or choose an "
      "isolated processor",
      cpu, cpu, cpu);
}

std::string interrupts_of(int cpu, const fs::path& root) {
  std::string found;
  int count = 0;
  for (const fs::path& irq : entries(root / "proc/irq")) {
    std::string list = first_line(irq / "effective_affinity_list");
    if (list.empty()) list = first_line(irq / "smp_affinity_list");
    if (!lists(list, cpu)) continue;
    ++count;
    if (found.empty()) found = irq.filename();
  }
  if (count == 0) return "";
  return fmt::format(
      "{} served on processor {}, as interrupt {}; write another processor to "
      "/proc/irq/{}/smp_affinity_list, and stop irqbalance",
      count == 1 ? "1 interrupt is" : fmt::format("{} interrupts are", count), cpu, found, found);
}

}  // namespace

std::vector<std::string> real_time_obstacles(int cpu, const fs::path& root) {
  std::vector<std::string> found;
  const auto note = [&found](std::string line) {
    if (!line.empty()) found.push_back(std::move(line));
  };
  // Processors are usually configured alike, so the first one with a problem is reported.
  const auto note_first = [&](auto check) {
    for (const fs::path& processor : processors(cpu, root))
      if (std::string line = check(processor); !line.empty()) return note(std::move(line));
  };
  note_first(governor_of);
  note_first(idle_states_of);
  if (cpu < 0) {
    note("the loop is not pinned, so it can be moved between processors; set realtime: cpu");
  } else {
    note(isolation_of(cpu, root));
    note(interrupts_of(cpu, root));
  }
  return found;
}

}  // namespace stageid
