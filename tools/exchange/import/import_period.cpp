#include "tools/exchange/import/import_signals.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "acquisition/files/counted.hpp"

namespace stageid {
namespace {

/// A period belongs to a run if its correlation with the first one is above this. With noise as strong as the
/// excitation it is 1/2; with another excitation of N samples about 1 / sqrt(N).
constexpr double kSameExcitation = 0.5;

double correlation(const SampleRows& a, const SampleRows& b) {
  const double size = a.norm() * b.norm();
  if (size > 0.0) return a.cwiseProduct(b).sum() / size;
  return a.isZero(0.0) == b.isZero(0.0) ? 1.0 : 0.0;
}

/// Pieces of whole periods in which the excitation repeats.
std::vector<RunRows> pieces_of(const SampleRows& all, Eigen::Index period, bool exact) {
  std::vector<RunRows> pieces;
  for (Eigen::Index at = 0; at + period <= all.rows(); at += period) {
    const SampleRows here = all.middleRows(at, period);
    const bool goes_on = !pieces.empty() && [&] {
      const SampleRows begin = all.middleRows(pieces.back().first, period);
      return exact ? begin == here : correlation(begin, here) > kSameExcitation;
    }();
    if (goes_on)
      pieces.back().count += period;
    else
      pieces.push_back({at, period});
  }
  return pieces;
}

/// "runs: [{...}, {...}, ...]" as required in the map.
std::string runs_text(const std::vector<RunRows>& pieces, Eigen::Index first) {
  constexpr std::size_t kMost = 3;
  std::string text = "runs: [";
  for (std::size_t k = 0; k < pieces.size() && k < kMost; ++k)
    text += fmt::format("{}{{realization: ..., experiment: ..., first_row: {}, rows: {}}}",
                        k == 0 ? "" : ", ", first + pieces[k].first, pieces[k].count);
  return text + (pieces.size() > kMost ? ", ...]" : "]");
}

/// Whether there are several runs, each of more than one period.
bool are_runs(const std::vector<RunRows>& pieces, Eigen::Index period) {
  return pieces.size() > 1 && std::ranges::all_of(pieces, [period](const RunRows& piece) {
           return piece.count > period;
         });
}

[[noreturn]] void fail_not_repeating(const ImportMap& map, const std::vector<RunRows>& pieces,
                                     const RunRows& rows, bool mean) {
  const auto period = static_cast<Eigen::Index>(map.period_samples);
  const Eigen::Index row = rows.first + pieces[1].first;
  if (are_runs(pieces, period))
    refuse_map(map,
               "excitation: changes at row {} and repeats from there on; the file "
               "contains {} in sequence. {} {}",
               row, counted(pieces.size(), "run"),
               map.runs.empty() ? "Add the key" : "Correct the key", runs_text(pieces, rows.first));
  if (mean)
    refuse_map(map,
               "excitation: the period at row {} differs from that at row {}. Correct "
               "period_samples: {}, or list the rows of each run in the key runs",
               row, rows.first, period);
  refuse_map(map,
             "excitation: does not repeat from row {} on. Correct period_samples: {}, or "
             "list the rows of each run in the key runs. If the excitation was measured, "
             "add excitation_period: mean",
             row, period);
}

}  // namespace

RunRows rows_of(const ArrayList& arrays, const ImportMap& map, const ImportMap::Run& run,
                Eigen::Index samples) {
  const auto period = static_cast<Eigen::Index>(map.period_samples);
  RunRows rows{static_cast<Eigen::Index>(run.first_row), static_cast<Eigen::Index>(run.rows)};
  if (rows.first > samples || rows.count > samples - rows.first)
    refuse_map(map, "runs: rows {} to {} are out of range; {} has {}", rows.first,
               rows.first + rows.count, arrays.file.string(), samples);
  if (rows.count == 0) rows.count = samples - rows.first;
  const Eigen::Index periods = rows.count / period;
  const std::string where = map.runs.empty()
                                ? fmt::format("{} has", arrays.file.string())
                                : fmt::format("runs: the run at row {} has", rows.first);
  if (periods <= static_cast<Eigen::Index>(map.transient_periods))
    refuse_map(
        map, "{} {}, {} of period_samples: {}; expected {} and at least one more. Correct {}",
        where, counted(rows.count, "row"), counted(periods, "whole period"), period,
        counted(map.transient_periods, "transient period"),
        map.transient_periods > 0 ? "transient_periods or period_samples" : "period_samples");
  if (rows.count % period != 0)
    refuse_map(map,
               "{} {}, not a multiple of period_samples: {}. {} {{first_row: {}, rows: "
               "{}}} to use {}, or correct period_samples",
               where, counted(rows.count, "row"), period,
               map.runs.empty() ? "Add the key runs with" : "Write", rows.first, periods * period,
               counted(periods, "period"));
  return rows;
}

Eigen::MatrixXd period_of(const ArrayList& arrays, const ImportMap& map,
                          const SignalGroup& excitation, const RunRows& rows) {
  const auto period = static_cast<Eigen::Index>(map.period_samples);
  if (excitation.samples.rows() == period) return excitation.samples;
  if (rows.first + rows.count > excitation.samples.rows())
    arrays.fail(map.excitation.arrays.front(),
                "has {} samples; expected at least {}, the last row of a run, or one period of {}",
                excitation.samples.rows(), rows.first + rows.count, period);
  const SampleRows all = excitation.samples.middleRows(rows.first, rows.count);
  const bool mean = map.excitation_period == ImportMap::ExcitationPeriod::mean;
  const Eigen::Index first = mean ? static_cast<Eigen::Index>(map.transient_periods) * period : 0;
  const SampleRows settled = all.bottomRows(all.rows() - first);
  const std::vector<RunRows> pieces = pieces_of(settled, period, !mean);
  if (pieces.size() > 1)
    fail_not_repeating(
        map, pieces_of(all, period, !mean).size() > 1 ? pieces_of(all, period, !mean) : pieces,
        rows, mean);
  if (!mean) return all.topRows(period);
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(period, all.cols());
  for (Eigen::Index at = 0; at < settled.rows(); at += period)
    sum += settled.middleRows(at, period);
  const Eigen::Index periods = settled.rows() / period;
  return sum / static_cast<double>(periods);
}

}  // namespace stageid
