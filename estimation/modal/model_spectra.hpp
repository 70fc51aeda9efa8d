#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "acquisition/record/log_reader.hpp"
#include "estimation/modal/period_spectra.hpp"
#include "estimation/model/additive_model.hpp"
#include "excitation/multisine/dft.hpp"

namespace stageid {

/// The lines of the DFT of one period in a band, DC and Nyquist excluded; possibly none.
std::vector<int> lines_in_band(const LogInfo& info, double low_hz, double high_hz);

/// Reads the channels of a model from a log, as spectra of single periods.
class ModelSpectra {
 public:
  /// @throws std::invalid_argument if the log lacks a channel of the model
  ModelSpectra(const AdditiveModel& model, const LogReader& log, std::vector<int> lines);

  /// Rows [period_samples * period, ...) of a run; none if a sample is marked. @param log of the same channels
  /// @throws the same as LogReader::read()
  std::optional<PeriodSpectra> read(const LogReader& log, std::size_t run, std::uint64_t period);

 private:
  Eigen::MatrixXcd spectra(const Eigen::MatrixXd& samples,
                           const std::vector<Eigen::Index>& channels);

  RealDft dft_;
  std::vector<int> lines_;
  std::vector<Eigen::Index> inputs_;
  std::vector<Eigen::Index> outputs_;
  LogSamples samples_;
};

}  // namespace stageid
