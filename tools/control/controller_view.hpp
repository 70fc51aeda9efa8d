#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "estimation/loop/loop_view.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/terminal/json.hpp"

namespace stageid {

/// The loop of a model with the controller of a stage.
struct ControllerView {
  std::vector<std::string> loops;
  double sample_rate_hz = 0.0;
  std::string model_fingerprint = {};  ///< of its file; empty: unknown
  LoopView view;
};

/// @param covariance of the parameters of the model, 0 x 0: unknown
/// @throws std::invalid_argument naming the stage file, as stage_loop() and loop_view()
ControllerView controller_view(const StageConfig& stage, const AdditiveModel& model,
                               const Eigen::MatrixXd& covariance,
                               const Eigen::VectorXd& frequency_hz);

/// stageid-controller-view as in docs/formats.md: poles, margins and, with `curves`, the curves with their discs.
Json controller_view_json(const ControllerView& view, bool curves);
/// The curves as a table, one row per line.
std::string controller_view_csv(const ControllerView& view);
/// For people: one line per loop, one on the multivariable loop.
std::vector<std::string> controller_view_lines(const ControllerView& view);

/// The text of such a .json file with its curves, checked.
/// @param model file that the view must belong to; empty: any
/// @throws FileError, FormatError
std::string read_controller_view(const std::filesystem::path& file,
                                 const std::filesystem::path& model);

/// Writes the view by the ending of the file, .json or .csv, atomically. @throws FileError
void write_controller_view(const std::filesystem::path& file, const ControllerView& view);

}  // namespace stageid
