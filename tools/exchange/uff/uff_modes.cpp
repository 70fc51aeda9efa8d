#include "tools/exchange/uff/uff_modes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimation/modal/modal_form.hpp"
#include "tools/exchange/uff/uff_frf.hpp"

namespace stageid {
namespace {

/// Three values per node, because common readers only support 3 and 6, not the scalars of the format. A scalar output
/// is stored as X (note 15 of the format: unused degrees of freedom are zero).
UffMode uff_mode(const ModeShape& shape, const ChannelList& outputs) {
  UffMode mode;
  mode.complex = !shape.output_shape.imag().isZero(0.0);
  const double omega = 2.0 * std::numbers::pi * shape.natural_frequency_hz;
  const double zeta = shape.damping_ratio;
  const double damped = omega * std::sqrt(std::max(0.0, 1.0 - zeta * zeta));
  mode.frequency_hz = shape.natural_frequency_hz;
  mode.damping_ratio = zeta;
  mode.modal_mass = shape.modal_mass;
  mode.pole_rad_s = {-zeta * omega, damped};
  mode.modal_a = {0.0, 2.0 * damped * shape.modal_mass};
  mode.values_per_node = 3;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    mode.nodes.push_back(static_cast<long long>(i) + 1);
    const std::complex<double> value = shape.output_shape[static_cast<Eigen::Index>(i)];
    const int direction = std::max(1, uff_direction(outputs.names[i]));
    for (int axis = 1; axis <= 3; ++axis) mode.values.push_back(axis == direction ? value : 0.0);
  }
  return mode;
}

}  // namespace

std::vector<UffMode> uff_modes(const AdditiveModel& model) {
  std::vector<UffMode> modes;
  for (const ModeShape& shape : mode_shapes(model)) {
    if (!std::isfinite(shape.modal_mass)) continue;
    modes.push_back(uff_mode(shape, model.outputs));
    UffMode& mode = modes.back();
    mode.number = static_cast<int>(modes.size());
    mode.id[0] = fmt::format("mode {}: {:.6g} Hz, damping ratio {:.4g}", mode.number,
                             mode.frequency_hz, mode.damping_ratio);
  }
  return modes;
}

}  // namespace stageid
