#pragma once

#include <nlohmann/json.hpp>

#include "estimation/modal/modal_form.hpp"
#include "estimation/model/additive_model.hpp"
#include "hal/stage/stage.hpp"

namespace stageid::report {

/// The modes of a model with their shapes, by frequency, for animation and comparison.
std::vector<ModeShape> shapes_by_frequency(const AdditiveModel& model);

/// {"modes": [{frequency_hz, damping_ratio, modal_mass, not_rank_one, outputs: [re, im, ...],
/// inputs: [re, im, ...]}], "output_mac": [[...]], "input_mac": [[...]]}; the MACs modes x modes.
nlohmann::json shapes_json(const AdditiveModel& model);

/// {"outputs": [{position_m, direction} or null], "inputs": [...]} in the order of the channels of the model, by name;
/// null if no channel has a position.
nlohmann::json geometry_json(const StageInfo& geometry, const ChannelList& outputs,
                             const ChannelList& inputs);

/// Four decimals of a MAC; null if it is not finite.
nlohmann::json rounded_mac(double value);

/// Rows of a matrix, every value as `rounding` gives it.
nlohmann::json matrix_json(const Eigen::MatrixXd& matrix, nlohmann::json (*rounding)(double));

}  // namespace stageid::report
