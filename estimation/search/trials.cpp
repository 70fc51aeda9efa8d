#include "estimation/search/trials.hpp"

#include <algorithm>
#include <vector>

#include "estimation/model/model_structure.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "estimation/search/search_constants.hpp"
#include "frf/response/channel_positions.hpp"

namespace stageid {

FitOptions trial_options(const FrfEstimate& frf, const FitOptions& options) {
  FitOptions trial = options;
  trial.user_weights = make_weights(frf, options);
  trial.weighting = Weighting::user;
  trial.user_weight_matrices.resize(0, 0);
  trial.method = FitMethod::gn;
  trial.residue_rank = trial.rigid_body_rank = 0;
  trial.mode_ranks.clear();
  trial.uncertainty = trial.covariance = trial.judge_modes = trial.shrink_hidden = false;
  trial.max_iterations = std::min(kGrowthIterations, options.max_iterations);
  trial.gradient_tolerance = 1e-5;
  trial.step_tolerance = 1e-7;
  return trial;
}

PartOfData part_of_data(const FrfEstimate& frf, const FitOptions& options,
                        const AdditiveModel& model) {
  const Eigen::Index wanted =
      std::max<Eigen::Index>(kPartLines, kPartLinesOfAMode * count_modes(model));
  const Eigen::Index step = std::max<Eigen::Index>(1, frf.lines() / wanted);
  const auto lines = Eigen::seqN(0, (frf.lines() - 1) / step + 1, step);
  const Eigen::Index count =
      std::clamp<Eigen::Index>(kPartChannels / frf.n_outputs(), 1, frf.n_inputs());
  std::vector<Eigen::Index> inputs;
  std::vector<Eigen::Index> channels;
  for (Eigen::Index u = 0; u < count; ++u) {
    inputs.push_back(u * (frf.n_inputs() / count));
    for (Eigen::Index y = 0; y < frf.n_outputs(); ++y)
      channels.push_back(inputs.back() * frf.n_outputs() + y);
  }
  PartOfData out;
  out.all = step == 1 && count == frf.n_inputs();
  out.options = options;
  out.options.user_weights = Eigen::MatrixXd((*options.user_weights)(channels, lines));
  out.frf.frequency_hz = frf.frequency_hz(lines);
  out.frf.response = frf.response(channels, lines);
  out.frf.correlated_lines = frf.correlated_lines;
  out.frf.inputs = pick(frf.inputs, inputs);
  out.frf.outputs = frf.outputs;
  out.frf.sample_rate_hz = frf.sample_rate_hz;
  out.frf.hold = frf.hold;
  out.model = of_inputs(frf, model, inputs);
  return out;
}

AdditiveModel with_all_inputs(const FrfEstimate& frf, AdditiveModel model) {
  if (model.n_inputs() == frf.n_inputs()) return model;
  if (model.input_delay_s.size() > 0)
    model.input_delay_s.setConstant(frf.n_inputs(), model.input_delay_s.mean());
  model.inputs = frf.inputs;
  for (Submodel& s : model.submodels)
    for (Eigen::MatrixXd& B : s.numerator) B.setZero(frf.n_outputs(), frf.n_inputs());
  return model;
}

}  // namespace stageid
