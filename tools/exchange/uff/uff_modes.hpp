#pragma once

#include <vector>

#include "estimation/model/additive_model.hpp"
#include "tools/exchange/uff/uff_file.hpp"

namespace stageid {

/// The modes of a model as datasets 55: shapes of the outputs at nodes 1 .. n_y, the nodes of uff_of_frf(). Every node
/// has three values. Names that begin with x, y or z give the direction; other outputs are stored as X. Real shapes
/// are normal modes with natural frequency, modal mass and damping ratio; complex ones are eigenvalues with modal A =
/// 2 j omega sqrt(1 - zeta^2) modal_mass, so that the residue is shape_out shape_in^T / A. Source of the scaling:
/// estimation/modal/modal_form.hpp.
std::vector<UffMode> uff_modes(const AdditiveModel& model);

}  // namespace stageid
