#include "estimation/search/part_of_data.hpp"

#include <algorithm>
#include <vector>

#include "estimation/model/model_structure.hpp"
#include "estimation/search/search_constants.hpp"

namespace stageid {

PartOfData part_of_data(const FrfEstimate& frf, const FitOptions& options,
                        const AdditiveModel& model) {
  const Eigen::Index wanted =
      std::max<Eigen::Index>(kPartLines, kPartLinesOfAMode * count_modes(model));
  const Eigen::Index step = std::max<Eigen::Index>(1, frf.lines() / wanted);
  const auto lines = Eigen::seqN(0, (frf.lines() - 1) / step + 1, step);
  const Eigen::Index count =
      std::clamp<Eigen::Index>(kPartChannels / frf.n_outputs(), 1, frf.n_inputs());
  const auto inputs = Eigen::seqN(0, count, frf.n_inputs() / count);
  std::vector<Eigen::Index> channels;
  PartOfData out;
  for (Eigen::Index u = 0; u < count; ++u) {
    for (Eigen::Index y = 0; y < frf.n_outputs(); ++y)
      channels.push_back(inputs[u] * frf.n_outputs() + y);
    out.frf.inputs.names.push_back(frf.inputs.names[static_cast<std::size_t>(inputs[u])]);
    out.frf.inputs.units.push_back(frf.inputs.units[static_cast<std::size_t>(inputs[u])]);
  }
  out.all = step == 1 && count == frf.n_inputs();
  out.options = options;
  out.options.user_weights = Eigen::MatrixXd((*options.user_weights)(channels, lines));
  out.frf.frequency_hz = frf.frequency_hz(lines);
  out.frf.response = frf.response(channels, lines);
  out.frf.outputs = frf.outputs;
  out.frf.sample_rate_hz = frf.sample_rate_hz;
  out.frf.hold = frf.hold;
  out.model = model;
  out.model.inputs = out.frf.inputs;
  if (model.input_delay_s.size() > 0) out.model.input_delay_s = model.input_delay_s(inputs).eval();
  for (Submodel& s : out.model.submodels)
    for (Eigen::MatrixXd& B : s.numerator) B = B(Eigen::all, inputs).eval();
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
