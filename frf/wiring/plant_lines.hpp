#pragma once

#include <Eigen/Core>
#include <vector>

#include "frf/runs/health_record.hpp"
#include "frf/wiring/nominal_stage.hpp"

namespace stageid {

/// The plant on one line without the nominal phase of hold and delay: real for a stage without damping.
struct PlantLine {
  double omega_rad_s = 0.0;
  Eigen::MatrixXcd G;        ///< outputs x inputs, measured
  Eigen::MatrixXcd G0;       ///< the nominal rigid body
  Eigen::MatrixXd variance;  ///< E|dG|^2; zeros with only one period
};

/// G = Y U^-1 of the record on its lines from nominal.free_from_hz on; lines with singular excitation are skipped.
/// @param outputs sensors, `inputs` excited actuators, in the order of record.axes
std::vector<PlantLine> plant_lines(const HealthRecord& record, const NominalStage& nominal,
                                   const std::vector<Eigen::Index>& outputs,
                                   const std::vector<Eigen::Index>& inputs);

}  // namespace stageid
