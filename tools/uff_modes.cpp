#include "tools/uff_modes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "estimation/modal_form.hpp"
#include "tools/uff_frf.hpp"

namespace stageid {
namespace {

UffMode uff_mode(const ModeShape& shape, const ChannelList& outputs, bool directed) {
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
  mode.values_per_node = directed ? 3 : 1;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    mode.nodes.push_back(static_cast<long long>(i) + 1);
    const std::complex<double> value = shape.output_shape[static_cast<Eigen::Index>(i)];
    const int direction = uff_direction(outputs.names[i]);
    for (int axis = 1; directed && axis <= 3; ++axis)
      mode.values.push_back(axis == direction ? value : 0.0);
    if (!directed) mode.values.push_back(value);
  }
  return mode;
}

}  // namespace

std::vector<UffMode> uff_modes(const AdditiveModel& model) {
  const auto& names = model.outputs.names;
  const bool directed = std::all_of(names.begin(), names.end(),
                                    [](const auto& name) { return uff_direction(name) != 0; });
  std::vector<UffMode> modes;
  for (const ModeShape& shape : mode_shapes(model)) {
    if (!std::isfinite(shape.modal_mass)) continue;
    modes.push_back(uff_mode(shape, model.outputs, directed));
    UffMode& mode = modes.back();
    mode.number = static_cast<int>(modes.size());
    mode.id[0] = fmt::format("mode {}: {:.6g} Hz, damping ratio {:.4g}", mode.number,
                             mode.frequency_hz, mode.damping_ratio);
  }
  return modes;
}

}  // namespace stageid
