// Tests whether the program recognizes right and wrong models.
//
//   judgement_study COUNT FIRST_SEED [--trouble NAME]... [--jobs N] [--output FILE] [--program FILE] [--keep DIRECTORY]
//
// COUNT random stages, each clean and with every trouble planted, measured in virtual time, estimated and fitted by the
// program with default settings, and compared with the exact plant. One JSON line per case is appended to FILE
// (default: judgement.jsonl); cases that it has are not repeated. The table at the end is of all lines in FILE with
// seeds and troubles that were asked for. --keep leaves log, FRF and model of every case in DIRECTORY.
//
// Columns: cases; how many ended with exit code 0, with 3, with another; of those without 0 how many named the planted
// cause first; of all how many were judged right (exit 0 and not garbage, or the right cause); 95 % intervals of
// natural frequency and damping that hold where the exit code was 0; garbage with exit 0; modes missed and surplus with
// exit 0; dropped periods per 1000; median processor seconds of the program.

#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "acquisition/files/json_text.hpp"
#include "tests/support/judgement/judgement_case.hpp"

namespace {

using namespace stageid;
using namespace stageid::test;
using Json = nlohmann::ordered_json;

struct Arguments {
  int count = 10;
  int first = 1;
  int jobs = 1;
  std::vector<Trouble> troubles;
  std::filesystem::path output = "judgement.jsonl";
  std::filesystem::path program = STAGEID_PROGRAM;
  std::filesystem::path keep;
};

Arguments parse(int argc, char** argv) {
  Arguments a;
  int position = 0;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.rfind("--", 0) != 0) {
      (position++ == 0 ? a.count : a.first) = std::atoi(argv[i]);
      continue;
    }
    if (i + 1 == argc) throw std::invalid_argument(word + ": a value is missing");
    const std::string value = argv[++i];
    if (word == "--trouble") {
      const auto trouble = from_word<Trouble>(value);
      if (!trouble) throw std::invalid_argument("--trouble: unknown '" + value + "'");
      a.troubles.push_back(*trouble);
    } else if (word == "--jobs") {
      a.jobs = std::max(1, std::atoi(value.c_str()));
    } else if (word == "--output") {
      a.output = value;
    } else if (word == "--program") {
      a.program = value;
    } else if (word == "--keep") {
      a.keep = value;
    } else {
      throw std::invalid_argument("unknown option " + word);
    }
  }
  if (a.troubles.empty())
    for (std::size_t i = 0; i < kWords<Trouble>.size(); ++i)
      a.troubles.push_back(static_cast<Trouble>(i));
  return a;
}

using Case = std::pair<int, std::string>;  // seed, trouble

std::map<Case, Json> read_results(const std::filesystem::path& file) {
  std::map<Case, Json> results;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) {
    const Json json = Json::parse(line, nullptr, false);
    if (json.is_object()) results[{json["seed"], json["trouble"]}] = json;
  }
  return results;
}

/// Of worker `worker`: every `jobs`-th case. One write per line, so that lines of several workers do not mix.
void work(const Arguments& a, const std::vector<std::pair<int, Trouble>>& cases, int worker) {
  for (std::size_t i = static_cast<std::size_t>(worker); i < cases.size();
       i += static_cast<std::size_t>(a.jobs)) {
    const auto [seed, trouble] = cases[i];
    Json result;
    try {
      const std::filesystem::path keep =
          a.keep.empty() ? a.keep : a.keep / fmt::format("{}-{}", seed, to_string(trouble));
      result = judge_case(static_cast<std::uint64_t>(seed), trouble, a.program, keep);
    } catch (const std::exception& error) {
      result = {
          {"seed", seed}, {"trouble", to_string(trouble)}, {"exit", -1}, {"said", error.what()}};
    }
    const std::string line = json_line(result) + "\n";
    std::FILE* stream = std::fopen(a.output.c_str(), "a");
    if (stream == nullptr) std::_Exit(1);
    std::fwrite(line.data(), 1, line.size(), stream);
    std::fclose(stream);
  }
}

struct Row {
  int cases = 0, done = 0, doubted = 0, other = 0, right_cause = 0, judged_right = 0, garbage = 0;
  int intervals[2] = {0, 0}, hold[2] = {0, 0};
  int missed = 0, surplus = 0;
  double dropped = 0.0, periods = 0.0;
  std::vector<double> seconds;

  void add(const Json& r) {
    ++cases;
    const int exit = r.value("exit", -1);
    const bool bad = is_garbage(r);
    const bool right = r.value("right", false);
    done += exit == 0;
    doubted += exit == 3;
    other += exit != 0 && exit != 3;
    right_cause += right;
    garbage += bad;
    judged_right += right || (exit == 0 && !bad);
    dropped += r.value("dropped", 0);
    periods += r.value("periods", 0);
    seconds.push_back(r.value("seconds", 0.0));
    if (exit != 0) return;
    missed += r.value("true_modes", 0) - r.value("found", 0);
    surplus += r.contains("extra") ? static_cast<int>(r["extra"].size()) : 0;
    const char* keys[2] = {"df", "dz"};
    for (int k = 0; k < 2; ++k)
      for (const Json& deviation : r.value(keys[k], Json::array())) {
        ++intervals[k];
        hold[k] += std::abs(deviation.get<double>()) < 1.96;
      }
  }
};

std::string percent(int part, int whole) {
  return whole == 0 ? "-" : fmt::format("{:.1f}", 100.0 * part / whole);
}

void print(const std::string& name, Row row) {
  std::sort(row.seconds.begin(), row.seconds.end());
  fmt::print("{:30} {:5} {:6} {:6} {:5} {:6} {:6} {:6} {:6} {:7} {:6} {:7} {:8.2f} {:6.2f}\n", name,
             row.cases, row.done, row.doubted, row.other,
             percent(row.right_cause, row.doubted + row.other),
             percent(row.judged_right, row.cases), percent(row.hold[0], row.intervals[0]),
             percent(row.hold[1], row.intervals[1]), row.garbage, row.missed, row.surplus,
             row.periods > 0.0 ? 1000.0 * row.dropped / row.periods : 0.0,
             row.seconds.empty() ? 0.0 : row.seconds[row.seconds.size() / 2]);
}

void print_table(const Arguments& a, const std::map<Case, Json>& results) {
  fmt::print(
      "{:30} {:>5} {:>6} {:>6} {:>5} {:>6} {:>6} {:>6} {:>6} {:>7} {:>6} {:>7} {:>8} {:>6}\n",
      "trouble", "n", "exit 0", "exit 3", "other", "cause%", "right%", "f 95%", "zeta", "garbage",
      "missed", "surplus", "dropped", "s");
  for (const Trouble trouble : a.troubles) {
    Row all;
    std::map<std::string, Row> variants;
    for (int seed = a.first; seed < a.first + a.count; ++seed) {
      const auto found = results.find({seed, to_string(trouble)});
      if (found == results.end()) continue;
      all.add(found->second);
      if (const std::string variant = found->second.value("variant", ""); !variant.empty())
        variants[variant].add(found->second);
    }
    print(to_string(trouble), all);
    for (const auto& [name, row] : variants) print("  " + name, row);
  }
}

int run(int argc, char** argv) {
  const Arguments a = parse(argc, argv);
  const std::map<Case, Json> known = read_results(a.output);
  std::vector<std::pair<int, Trouble>> cases;
  for (int seed = a.first; seed < a.first + a.count; ++seed)
    for (const Trouble trouble : a.troubles)
      if (known.count({seed, to_string(trouble)}) == 0) cases.emplace_back(seed, trouble);
  std::vector<pid_t> workers;
  for (int worker = 0; worker < a.jobs; ++worker) {
    const pid_t child = ::fork();
    if (child < 0) throw std::runtime_error("fork failed");
    if (child == 0) {
      work(a, cases, worker);
      std::_Exit(0);
    }
    workers.push_back(child);
  }
  bool whole = true;
  for (const pid_t worker : workers) {
    int status = 0;
    ::waitpid(worker, &status, 0);
    whole = whole && WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }
  print_table(a, read_results(a.output));
  return whole ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "judgement_study: {}\n", error.what());
    return 2;
  }
}
