#include "estimation/search/late_channels.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "acquisition/files/counted.hpp"
#include "estimation/search/search_constants.hpp"
#include "frf/statistics/order_statistic.hpp"

namespace stageid {
namespace {

constexpr std::size_t kMostNamed = 6;

/// Of one kind. With two channels, the earlier one counts as right.
void add_late(const ChannelList& channels, const Eigen::VectorXd& delay_s,
              const Eigen::VectorXd& std_s, double sample_rate_hz, std::vector<std::string>& out) {
  if (delay_s.size() < 2) return;
  std::vector<double> sorted(delay_s.begin(), delay_s.end());
  const double middle_s = value_of_rank(sorted, (sorted.size() - 1) / 2);
  for (Eigen::Index i = 0; i < delay_s.size(); ++i) {
    const double samples = (delay_s[i] - middle_s) * sample_rate_hz;
    const double deviation = std_s.size() > i ? std_s[i] * sample_rate_hz : 0.0;
    if (std::abs(samples) > std::max(kLeastSamples, kClearly * deviation))
      out.push_back(
          fmt::format("{} {:+.3g}", channels.names[static_cast<std::size_t>(i)], samples));
  }
}

}  // namespace

std::string late_channels(const AdditiveModel& model) {
  std::vector<std::string> late;
  add_late(model.outputs, model.output_delays_s(), model.output_delay_std_s, model.sample_rate_hz,
           late);
  add_late(model.inputs, model.input_delays_s(), model.input_delay_std_s, model.sample_rate_hz,
           late);
  if (late.empty()) return {};
  return fmt::format(
      "the delays of the channels differ: {} samples relative to the others. The model contains "
      "them. If all channels should be simultaneous, check the timing of the recorder",
      listed(late, kMostNamed));
}

}  // namespace stageid
