#include "tools/report/timing_json.hpp"

namespace stageid {
namespace {

SortedJson histogram_json(const TimingHistogram& histogram) {
  SortedJson bins = SortedJson::array();
  for (std::size_t bin = 0; bin < TimingHistogram::kBins; ++bin)
    if (histogram.count(bin) > 0)
      bins.push_back({1e-9 * static_cast<double>(TimingHistogram::lower_ns(bin)),
                      1e-9 * static_cast<double>(TimingHistogram::upper_ns(bin)),
                      histogram.count(bin)});
  return {{"median_s", histogram.quantile_s(0.5)},
          {"p99_s", histogram.quantile_s(0.99)},
          {"p99_9_s", histogram.quantile_s(0.999)},
          {"largest_s", histogram.quantile_s(1.0)},
          {"bins", std::move(bins)}};
}

}  // namespace

SortedJson timing_json(const RunTiming& timing) {
  if (timing.empty()) return nullptr;
  return {{"execution", histogram_json(timing.execution)},
          {"lateness", histogram_json(timing.lateness)},
          {"skipped", timing.skipped}};
}

}  // namespace stageid
