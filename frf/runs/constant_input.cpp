#include "frf/runs/constant_input.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace stageid {
namespace {

/// Whether row `row` of the spectra is nonzero in any run.
bool moves(const RealizationSpectra& spectra, std::size_t runs, Eigen::Index row) {
  for (std::size_t e = 0; e < runs; ++e) {
    const Eigen::MatrixXcd& mean = spectra.run(e).mean;
    for (Eigen::Index k = 0; k < mean.cols(); ++k)
      if (mean(row, k) != 0.0) return true;
  }
  return false;
}

}  // namespace

void refuse_constant_inputs(const RealizationRuns& realization, const RealizationSpectra& spectra,
                            const ChannelChoice& channels) {
  const auto outputs = static_cast<Eigen::Index>(channels.outputs.size());
  for (std::size_t i = 0; i < channels.estimated.size(); ++i) {
    if (moves(spectra, realization.runs.size(), outputs + static_cast<Eigen::Index>(i))) continue;
    const UsedRun& run = realization.runs.front();
    const auto channel = static_cast<std::size_t>(channels.estimated[i]);
    throw std::invalid_argument(fmt::format(
        "{}/actuators: channel {} is constant throughout realization {} (counted from 1), so the "
        "response cannot be estimated. Check its cable and which signal is recorded",
        run.place(), run.log->info().actuators.names[channel], realization.realization + 1));
  }
}

}  // namespace stageid
