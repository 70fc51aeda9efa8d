#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "estimation/modal/mode_shapes.hpp"
#include "estimation/model/additive_model.hpp"
#include "estimation/start/stabilization.hpp"
#include "frf/response/nonlinearity.hpp"
#include "hal/stage/stage.hpp"

namespace stageid::report {

/// Null if there is none.
nlohmann::json number_json(const std::optional<double>& value);

/// Four decimals of a MAC; null if it is not finite.
nlohmann::json rounded_mac(double value);

/// Rows of a matrix, every value as `rounding` gives it.
nlohmann::json matrix_json(const Eigen::MatrixXd& matrix, nlohmann::json (*rounding)(double));

/// [[order, frequency_hz, damping_ratio, stability], ...]; stability 0: new, 1: frequency, 2: damping too.
nlohmann::json stabilization_json(const std::vector<StabilizationPole>& poles);

/// {"bands": [[low_hz, high_hz], ...], "p_value": [[channel], [band]], "distortion": the same,
/// "chance": share of tests that a linear plant fails by chance}; channel = output + outputs * input.
nlohmann::json nonlinearity_json(const NonlinearityTest& test);

/// The modes of a model with their shapes, by frequency, for animation and comparison.
std::vector<ModeShape> shapes_by_frequency(const AdditiveModel& model);

/// {"modes": [{frequency_hz, damping_ratio, modal_mass, not_rank_one, outputs: [re, im, ...],
/// inputs: [re, im, ...]}], "output_mac": [[...]], "input_mac": [[...]]}; the MACs modes x modes.
nlohmann::json shapes_json(const AdditiveModel& model);

/// {"outputs": [{position_m, direction} or null], "inputs": [...]} in the order of the channels of the model, by name;
/// null if no channel has a position.
nlohmann::json geometry_json(const StageInfo& geometry, const ChannelList& outputs,
                             const ChannelList& inputs);

}  // namespace stageid::report
