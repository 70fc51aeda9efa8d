#include "tools/exchange/import/import_runs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <set>
#include <stdexcept>

#include "acquisition/files/counted.hpp"
#include "acquisition/files/file_error.hpp"

namespace stageid {
namespace {

using Number = std::optional<long long> RunNumbers::*;

/// Rank of a number among all of them, from 0.
std::int64_t rank_of(long long number, const std::vector<RunNumbers>& all, Number which) {
  std::set<long long> numbers;
  for (const RunNumbers& run : all) numbers.insert((run.*which).value_or(number));
  return std::distance(numbers.begin(), numbers.find(number));
}

/// The source of the realization or experiment number of a run.
class Source {
 public:
  Source(const ImportMap& map, const char* what) : map_(map), what_(what) {}

  void take(const char* from, std::int64_t value) {
    if (from_ != nullptr)
      throw FormatError(map_.file, "",
                        fmt::format("the {} of a run is given by {} and by {}; keep one of them",
                                    what_, from_, from));
    from_ = from;
    value_ = value;
  }
  std::int64_t value() const noexcept { return value_; }

 private:
  const ImportMap& map_;
  const char* what_;
  const char* from_ = nullptr;
  std::int64_t value_ = 0;
};

std::vector<ImportMap::Run> entries_of(const ImportMap& map, const RunAxes& axes) {
  if (!axes.has_runs) return map.runs.empty() ? std::vector<ImportMap::Run>(1) : map.runs;
  std::vector<ImportMap::Run> entries = map.runs;
  for (Eigen::Index r = 0; r < axes.runs && map.runs.empty(); ++r)
    entries.push_back({.realization = r});
  if (static_cast<Eigen::Index>(entries.size()) != axes.runs)
    throw FormatError(map.file, "",
                      fmt::format("runs: {}; axis run has {}. Give one entry per run",
                                  counted(entries.size(), "entry", "entries"), axes.runs));
  return entries;
}

}  // namespace

std::vector<ForeignFile> foreign_files(const std::filesystem::path& file, const ImportMap& map) {
  if (file.empty() && map.files.empty())
    throw std::invalid_argument(
        "no file to import; give FILE, or write its pattern in the map: files: "
        "run_{realization}_{experiment}.mat");
  if (!file.empty() && !map.files.empty())
    throw std::invalid_argument(
        fmt::format("{}: the map {} already lists the files {}; omit FILE or the key files",
                    file.string(), map.file.string(), map.files));
  const std::filesystem::path pattern = file.empty() ? map.file.parent_path() / map.files : file;
  if (!is_pattern(pattern.string())) return {{pattern, {}}};
  std::vector<ForeignFile> files;
  for (const auto& [numbers, path] : files_of(pattern)) files.push_back({path, numbers});
  if (files.empty())
    throw FileError(fmt::format(
        "{}: no file matches this pattern; check the folder and the numbers", pattern.string()));
  return files;
}

std::vector<ImportedRun> runs_of(const ArrayList& arrays, const ImportMap& map,
                                 const std::vector<ForeignFile>& files, const ForeignFile& file) {
  const RunAxes axes = run_axes_of(arrays, map);
  const std::vector<RunNumbers> names = name_numbers_of(arrays, map);
  std::vector<RunNumbers> file_numbers;
  for (const ForeignFile& other : files) file_numbers.push_back(other.numbers);
  const std::vector<ImportMap::Run> entries = entries_of(map, axes);
  std::vector<ImportedRun> runs;
  for (const RunNumbers& name : names)
    for (Eigen::Index m = 0; m < axes.realizations; ++m)
      for (Eigen::Index e = 0; e < axes.experiments; ++e)
        for (std::size_t r = 0; r < entries.size(); ++r) {
          Source realization(map, "realization"), experiment(map, "experiment");
          if (file.numbers.realization)
            realization.take(
                "the name of its file",
                rank_of(*file.numbers.realization, file_numbers, &RunNumbers::realization));
          if (file.numbers.experiment)
            experiment.take("the name of its file", rank_of(*file.numbers.experiment, file_numbers,
                                                            &RunNumbers::experiment));
          if (name.realization)
            realization.take("the names of the arrays",
                             rank_of(*name.realization, names, &RunNumbers::realization));
          if (name.experiment)
            experiment.take("the names of the arrays",
                            rank_of(*name.experiment, names, &RunNumbers::experiment));
          if (axes.has_realizations) realization.take("axis realization", m);
          if (axes.has_experiments) experiment.take("axis experiment", e);
          const bool listed = axes.has_runs || !map.runs.empty();
          const ImportMap::Run& entry = entries[r];
          if (listed && entry.realization != 0) realization.take("runs", entry.realization);
          if (listed && entry.experiment != 0) experiment.take("runs", entry.experiment);
          ImportedRun run{{name, m, e, static_cast<Eigen::Index>(r)}, entry};
          run.run.realization = realization.value();
          run.run.experiment = experiment.value();
          runs.push_back(run);
        }
  return runs;
}

}  // namespace stageid
