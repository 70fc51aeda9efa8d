#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimation/model/additive_model.hpp"
#include "estimation/tracking/watch_design.hpp"
#include "frf/response/frf_estimate.hpp"
#include "tools/experiment/experiment_config.hpp"

namespace stageid {

struct WatchRequest {
  std::filesystem::path model;  ///< model.json
  std::filesystem::path frf;    ///< frf.h5, for the noise
  double rms_m = 0.0;           ///< largest rms of a sensor; 0: the levels of the experiment
  double drift = 1e-5;          ///< of a natural frequency, relative
};

/// A permanent excitation of all axes at once.
struct WatchPlan {
  AdditiveModel model;
  std::vector<TrackedParameter> parameters;
  WatchForecast forecast;
  double gap = 0.0;            ///< see InformativePower
  std::vector<int> lines;      ///< of the period
  Eigen::VectorXd shape;       ///< relative amplitude, by line
  Eigen::MatrixXd phase_rad;   ///< axes x lines
  std::vector<double> levels;  ///< rms of each axis
};

/// Chooses those lines of an experiment, their amplitudes and the phases between the axes that give the smallest largest
/// deviation of the natural frequencies.
/// @throws FileError, FormatError
WatchPlan make_watch_plan(const ExperimentConfig& config, const WatchRequest& request);

/// Forecast for the first run of any experiment, with one false alarm per year. Its noise is that of an FRF as measured.
/// @throws FormatError
WatchForecast forecast_of(const ExperimentConfig& config, const AdditiveModel& model,
                          const FrfEstimate& frf, double drift);

/// The experiment file of a plan. @param file  to be written: the path of the stage file is relative to it
std::string watch_experiment_text(const WatchPlan& plan, const ExperimentConfig& config,
                                  const std::filesystem::path& file);

}  // namespace stageid
