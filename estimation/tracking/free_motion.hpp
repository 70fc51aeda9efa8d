#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimation/tracking/tracked_response.hpp"

namespace stageid {

/// What a motion that does not repeat leaves on the lines of one period, whatever the motion: the spectra of the free
/// responses of the stage, because the period ends in another state than it began. Those of a body that no spring holds
/// are a constant velocity and acceleration of each output; they come first. Those of a mode have its shape and its
/// poles; one matrix for every submodel with poles, (n_y N) x any, columns of norm 1, rows as in an n_y x N matrix.
/// Source: R. Pintelon and J. Schoukens, System Identification, 2nd ed. (2012), section 6.3.2.
std::vector<Eigen::MatrixXcd> free_motions(const TrackedResponse& response);

}  // namespace stageid
