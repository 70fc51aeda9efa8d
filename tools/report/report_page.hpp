#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "acquisition/record/log_info.hpp"
#include "estimation/modal/validation.hpp"
#include "estimation/model/additive_model.hpp"
#include "estimation/model/cmif.hpp"
#include "estimation/start/stabilization.hpp"
#include "frf/periods/health_finding.hpp"
#include "frf/response/frf_estimate.hpp"
#include "frf/response/nonlinearity.hpp"
#include "hal/stage/stage.hpp"
#include "tools/steps/problem.hpp"
#include "tools/steps/problem_commands.hpp"
#include "tools/steps/truth_comparison.hpp"

namespace stageid {

/// A labelled number or word for the header, as displayed: {"error against the plant", "0.12 %"}.
struct ReportFigure {
  std::string label;
  std::string value;
};

/// Duration of one step of the job.
struct ReportStep {
  std::string name;  ///< "run", "frf", "fit", ...
  double seconds = 0.0;
  std::string note;  ///< "512 MB/s", may be empty
};

/// A text stored with the result: a configuration, a plan. Shown verbatim, folded.
struct ReportDocument {
  std::string name;
  std::string text;
};

/// Another day or another model for comparison; its own parts may be absent. The channels are those of the report.
struct ReportComparison {
  std::string title;  ///< its name on the page
  std::optional<AdditiveModel> model;
  Eigen::MatrixXcd response;        ///< (n_y n_u) x N on frf's lines; 0 x 0: none, or the same
  Eigen::MatrixXcd model_response;  ///< same shape; 0 x 0: none
};

/// Content of the page. Every part may be absent; its section is then omitted.
struct ReportData {
  std::string title;

  bool all_lines = false;                     ///< also those outside the band of the model
  std::optional<FrfEstimate> frf;             ///< the fitted response
  std::optional<FrfEstimate> validation_frf;  ///< held back; same channels and lines as frf

  std::optional<AdditiveModel> model;
  Eigen::MatrixXcd model_response;  ///< (n_y n_u) x N on frf's lines, as measured; 0 x 0: none
  Eigen::MatrixXd model_variance;   ///< same shape, E|dP|^2; 0 x 0: unknown

  StageInfo geometry;  ///< name and channels; empty: shapes are drawn as bars

  Eigen::MatrixXd cmif_curves;  ///< accelerance, min(n_y, n_u) x N, largest first; 0 x 0: none
  std::vector<ModeCandidate> chosen_modes;  ///< start of the fit
  std::vector<TrueMode> true_modes;
  std::vector<StabilizationPole> stabilization;  ///< empty: no diagram
  std::optional<NonlinearityTest> nonlinearity;  ///< of frf's channels

  std::string
      controller_view;  ///< JSON of tools/control/controller_view.hpp with its curves; empty: none

  std::optional<ReportComparison> comparison;

  std::optional<Validation> validation;

  std::vector<Finding> findings;  ///< of the checks of the data, as `log info --health` orders them
  std::vector<LogRun> runs;       ///< timing and health of the measurement
  double sample_rate_hz = 0.0;    ///< of the runs; to show their speed relative to real time
  double period_s = 0.0;          ///< of the loop, by wall clock; 0: virtual time
  std::vector<ReportStep> steps;

  std::vector<ReportFigure> figures;  ///< further figures for the header
  std::vector<std::string> doubts;    ///< about the result, besides the findings; one line each
  std::vector<std::string> notes;     ///< about the page itself; one line each
  std::vector<ReportDocument> documents;
  ResultFiles files;  ///< for the commands in the head
};

/// Writes one self-contained page, atomically: no network, no other file. Equal data give equal bytes. All external
/// names and texts are escaped.
/// @pre The responses pass check(); CMIF curves, nonlinearity and validation were computed from them.
/// @throws std::invalid_argument if responses, model and variance do not belong together: "model_response: got 52 x 100;
/// expected ...".
/// @throws FileError
void write_report(const std::filesystem::path& file, const ReportData& data);

/// The page itself, UTF-8. @throws std::invalid_argument as write_report().
std::string report_page(const ReportData& data);

}  // namespace stageid
