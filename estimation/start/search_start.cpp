#include "estimation/start/search_start.hpp"

namespace stageid {

AdditiveModel search_start(const FrfEstimate& frf, const ModelStructure& structure,
                           const FitOptions& options, const AdditiveModel& known,
                           const std::vector<ModeCandidate>& modes) {
  AdditiveModel model;
  model.hold = options.hold;
  if (!known.submodels.empty()) {
    model.input_delay_s = known.input_delay_s;
    model.output_delay_s = known.output_delay_s;
  } else if (options.delay == DelayModel::fixed) {
    model.input_delay_s.setConstant(frf.n_inputs(), options.delay_s);
    model.output_delay_s.setZero(frf.n_outputs());
  }
  model.submodels = fixed_submodels(frf, structure);
  for (const ModeCandidate& mode : modes)
    model.submodels.push_back(mode_submodel(frf, structure, mode));
  return model;
}

ModeCandidate strongest_peak(const FrfEstimate& frf) {
  Eigen::Index k = 0;
  cmif(frf, CmifKind::accelerance).row(0).maxCoeff(&k);
  return {frf.frequency_hz[k], 0.01, 1};
}

}  // namespace stageid
