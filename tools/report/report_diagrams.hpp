#pragma once

#include <vector>

#include "estimation/modal/mode_shapes.hpp"
#include "estimation/model/additive_model.hpp"
#include "estimation/start/stabilization.hpp"
#include "frf/response/nonlinearity.hpp"
#include "hal/stage/stage.hpp"
#include "tools/terminal/json.hpp"

namespace stageid::report {

/// Four decimals of a MAC; null if it is not finite.
SortedJson rounded_mac(double value);

/// Rows of a matrix, every value as `rounding` gives it.
SortedJson matrix_json(const Eigen::MatrixXd& matrix, SortedJson (*rounding)(double));

/// [[order, frequency_hz, damping_ratio, stability], ...]; stability 0: new, 1: frequency, 2: damping too.
SortedJson stabilization_json(const std::vector<StabilizationPole>& poles);

/// {"bands": [[low_hz, high_hz], ...], "p_value": [[channel], [band]], "distortion": the same,
/// "chance": share of tests that a linear plant fails by chance}; channel = output + outputs * input.
SortedJson nonlinearity_json(const NonlinearityTest& test);

/// The modes of a model with their shapes, by frequency, for animation and comparison.
std::vector<ModeShape> shapes_by_frequency(const AdditiveModel& model);

/// {"modes": [{frequency_hz, damping_ratio, modal_mass, not_rank_one, outputs: [re, im, ...],
/// inputs: [re, im, ...]}], "output_mac": [[...]], "input_mac": [[...]]}; the MACs modes x modes.
SortedJson shapes_json(const AdditiveModel& model);

/// {"outputs": [{position_m, direction} or null], "inputs": [...]} in the order of the channels of the model, by name;
/// null if no channel has a position.
SortedJson geometry_json(const StageInfo& geometry, const ChannelList& outputs,
                         const ChannelList& inputs);

}  // namespace stageid::report
