#include "tools/exchange/import/import_runs.hpp"

#include <iterator>
#include <set>
#include <stdexcept>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/fail.hpp"

namespace stageid {
namespace {

using Number = std::optional<long long> RunNumbers::*;

/// Rank of a number among all of them, from 0.
std::int64_t rank_of(long long number, const std::vector<RunNumbers>& all, Number which) {
  std::set<long long> numbers;
  for (const RunNumbers& run : all) numbers.insert((run.*which).value_or(number));
  return std::distance(numbers.begin(), numbers.find(number));
}

std::vector<ImportMap::Run> entries_of(const ImportMap& map, const RunAxes& axes) {
  if (!axes.contains("run")) return map.runs.empty() ? std::vector<ImportMap::Run>(1) : map.runs;
  std::vector<ImportMap::Run> entries = map.runs;
  const std::size_t runs = axes.at("run");
  for (std::size_t r = 0; r < runs && map.runs.empty(); ++r)
    entries.push_back({.realization = static_cast<std::int64_t>(r)});
  if (entries.size() != runs)
    refuse_map(map, "runs: {}; axis run has {}. Give one entry per run",
               counted(entries.size(), "entry", "entries"), runs);
  return entries;
}

}  // namespace

std::vector<ForeignFile> foreign_files(const std::filesystem::path& file, const ImportMap& map) {
  if (file.empty() && map.files.empty())
    throw std::invalid_argument(
        "no file to import; give FILE, or write its pattern in the map: files: "
        "run_{realization}_{experiment}.mat");
  if (!file.empty() && !map.files.empty())
    fail_request("{}: the map {} already lists the files {}; omit FILE or the key files",
                 file.string(), map.file.string(), map.files);
  const std::filesystem::path pattern = file.empty() ? map.file.parent_path() / map.files : file;
  if (!is_pattern(pattern.string())) return {{pattern, {}}};
  std::vector<ForeignFile> files;
  for (const auto& [numbers, path] : files_of(pattern)) files.push_back({path, numbers});
  if (files.empty())
    fail_file(pattern, "no file matches this pattern; check the folder and the numbers");
  return files;
}

std::vector<ImportedRun> runs_of(const ArrayList& arrays, const ImportMap& map,
                                 const std::vector<ForeignFile>& files, const ForeignFile& file) {
  const RunAxes axes = run_axes_of(arrays, map);
  const auto extent = [&axes](const char* axis) { return axes.contains(axis) ? axes.at(axis) : 1; };
  const std::vector<RunNumbers> names = name_numbers_of(arrays, map);
  std::vector<RunNumbers> file_numbers;
  for (const ForeignFile& other : files) file_numbers.push_back(other.numbers);
  const std::vector<ImportMap::Run> entries = entries_of(map, axes);
  std::vector<ImportedRun> runs;
  for (const RunNumbers& name : names)
    for (std::size_t m = 0; m < extent("realization"); ++m)
      for (std::size_t e = 0; e < extent("experiment"); ++e)
        for (std::size_t r = 0; r < entries.size(); ++r) {
          ImportedRun run{{name, {{"realization", m}, {"experiment", e}, {"run", r}}}, entries[r]};
          const auto number_of = [&](const std::string& what, Number which, std::size_t along_axis,
                                     std::int64_t listed) {
            std::vector<std::pair<std::string, std::int64_t>> sources;
            if (const auto number = file.numbers.*which)
              sources.emplace_back("the name of its file", rank_of(*number, file_numbers, which));
            if (const auto number = name.*which)
              sources.emplace_back("the names of the arrays", rank_of(*number, names, which));
            if (axes.contains(what)) sources.emplace_back("axis " + what, along_axis);
            if (listed != 0) sources.emplace_back("runs", listed);
            if (sources.size() > 1)
              refuse_map(map, "the {} of a run is given by {} and by {}; keep one of them", what,
                         sources[0].first, sources[1].first);
            return sources.empty() ? 0 : sources[0].second;
          };
          run.run.realization =
              number_of("realization", &RunNumbers::realization, m, entries[r].realization);
          run.run.experiment =
              number_of("experiment", &RunNumbers::experiment, e, entries[r].experiment);
          runs.push_back(run);
        }
  return runs;
}

}  // namespace stageid
