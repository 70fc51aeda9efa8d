#include "estimation/search/trials.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "estimation/fit/search_constants.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/fit_problem.hpp"
#include "frf/response/channel_positions.hpp"

namespace stageid {
namespace {

/// Up to `most` of `count` channels.
std::vector<Eigen::Index> spread(Eigen::Index most, Eigen::Index count) {
  const Eigen::Index chosen = std::min(most, count);
  std::vector<Eigen::Index> out(static_cast<std::size_t>(chosen));
  for (Eigen::Index i = 0; i < chosen; ++i) out[i] = i * count / chosen;
  return out;
}

/// Evenly spaced inputs and outputs, up to kPartChannels channels.
struct PartOfChannels {
  explicit PartOfChannels(const FrfEstimate& frf) {
    const auto side = static_cast<Eigen::Index>(std::sqrt(kPartChannels));
    outputs = spread(std::max(side, kPartChannels / frf.n_inputs()), frf.n_outputs());
    inputs = spread(kPartChannels / std::ssize(outputs), frf.n_inputs());
    for (const Eigen::Index u : inputs)
      for (const Eigen::Index y : outputs) channels.push_back(u * frf.n_outputs() + y);
  }

  /// Every process has all rows of it.
  template <typename Lines>
  FrfEstimate frf(const FrfEstimate& whole, const Lines& lines) const {
    FrfEstimate out;
    out.frequency_hz = whole.frequency_hz(lines);
    out.response = chosen_channels(*whole.team, whole.response, channels, lines);
    if (whole.noise_variance.size() > 0)
      out.noise_variance = chosen_channels(*whole.team, whole.noise_variance, channels, lines);
    if (whole.total_variance.size() > 0)
      out.total_variance = chosen_channels(*whole.team, whole.total_variance, channels, lines);
    out.noise_dof = whole.noise_dof;
    out.total_dof = whole.total_dof;
    out.correlated_lines = whole.correlated_lines;
    out.inputs = pick(whole.inputs, inputs);
    out.outputs = pick(whole.outputs, outputs);
    out.sample_rate_hz = whole.sample_rate_hz;
    out.hold = whole.hold;
    return out;
  }

  std::vector<Eigen::Index> outputs;
  std::vector<Eigen::Index> inputs;
  std::vector<Eigen::Index> channels;
};

AdditiveModel of_channels(AdditiveModel model, const FrfEstimate& part,
                          const std::vector<Eigen::Index>& outputs,
                          const std::vector<Eigen::Index>& inputs) {
  model.inputs = part.inputs;
  model.outputs = part.outputs;
  if (model.input_delay_s.size() > 0) model.input_delay_s = model.input_delay_s(inputs).eval();
  if (model.output_delay_s.size() > 0) model.output_delay_s = model.output_delay_s(outputs).eval();
  for (Submodel& s : model.submodels)
    for (Eigen::MatrixXd& B : s.numerator) B = B(outputs, inputs).eval();
  return model;
}

PartOfData part(const FrfEstimate& frf, const FitOptions& options, const AdditiveModel& model,
                Eigen::Index step) {
  const auto lines = Eigen::seqN(0, (frf.lines() - 1) / step + 1, step);
  const PartOfChannels some(frf);
  PartOfData out;
  out.all = step == 1 && std::ssize(some.channels) == frf.response.rows();
  out.options = options;
  out.options.user_weights =
      chosen_channels(*frf.team, *options.user_weights, some.channels, lines);
  out.frf = some.frf(frf, lines);
  out.model = of_channels(model, out.frf, some.outputs, some.inputs);
  return out;
}

}  // namespace

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
  return part(frf, options, model, std::max<Eigen::Index>(1, frf.lines() / wanted));
}

PartOfData part_of_channels(const FrfEstimate& frf, const FitOptions& options,
                            const AdditiveModel& model) {
  return part(frf, options, model, 1);
}

FrfEstimate some_channels(const FrfEstimate& frf) {
  return PartOfChannels(frf).frf(frf, Eigen::seqN(0, frf.lines()));
}

AdditiveModel with_all_channels(const FrfEstimate& frf, AdditiveModel model) {
  if (model.n_inputs() == frf.n_inputs() && model.n_outputs() == frf.n_outputs()) return model;
  if (model.input_delay_s.size() > 0) {
    model.input_delay_s.setConstant(frf.n_inputs(), model.input_delay_s.mean());
    if (model.n_outputs() < frf.n_outputs()) {
      model.input_delay_s.array() += model.output_delay_s.mean();
      model.output_delay_s.setZero(frf.n_outputs());
    }
  }
  model.inputs = frf.inputs;
  model.outputs = frf.outputs;
  for (Submodel& s : model.submodels)
    for (Eigen::MatrixXd& B : s.numerator) B.setZero(frf.n_outputs(), frf.n_inputs());
  return model;
}

}  // namespace stageid
