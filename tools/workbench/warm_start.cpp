#include "tools/workbench/warm_start.hpp"

#include <memory>

#include "estimation/fit/fit_additive_model.hpp"
#include "estimation/model/model_structure.hpp"
#include "estimation/problem/search_limit.hpp"

namespace stageid {

AdditiveModel warm_start(const FitSetup& setup, const AdditiveModel* before) {
  const FrfEstimate& frf = setup.frf;
  AdditiveModel start;
  start.hold = setup.options.hold;
  if (setup.options.delay == DelayModel::fixed) {
    start.input_delay_s.setConstant(frf.n_inputs(), setup.options.delay_s);
    start.output_delay_s.setZero(frf.n_outputs());
  } else if (before != nullptr) {
    start.input_delay_s = before->input_delays_s();
    start.output_delay_s = before->output_delays_s();
  }
  start.submodels = fixed_submodels(frf, setup.structure.common);
  if (setup.structure.suspension) {
    if (setup.structure.suspension_hz.empty())
      start.submodels.push_back(suspension_mode(frf, kSuspensionStart * frf.frequency_hz[0]));
    for (const double frequency_hz : setup.structure.suspension_hz)
      start.submodels.push_back(suspension_mode(frf, frequency_hz));
  }
  for (const ModeCandidate& mode : setup.selection.modes)
    start.submodels.push_back(mode_submodel(frf, setup.structure.common, mode));
  FitOptions options = setup.options;
  options.max_iterations = 0;
  options.uncertainty = false;
  return fit_additive_model(frf, start, options).model;
}

AdditiveModel improved(const FitSetup& setup, const AdditiveModel& start,
                       const std::function<bool()>& enough) {
  FitOptions options = setup.options;
  options.uncertainty = false;
  options.limit = std::make_shared<SearchLimit>(0.0, enough);
  return fit_additive_model(setup.frf, start, options).model;
}

}  // namespace stageid
