#include "hal/can/can_bus_load.hpp"

#include <limits>

#include "excitation/words/require.hpp"
#include "hal/can/can_encoding.hpp"

namespace stageid {

double can_fd_frame_time_s(std::size_t bytes, double nominal_bit_rate_hz, double data_bit_rate_hz) {
  constexpr std::size_t kNominalBits = 17 + 4 + 13;
  const std::size_t dynamic = 5 + 8 * bytes;
  const std::size_t check = bytes > 16 ? 21 + 7 : 17 + 6;
  const std::size_t data_bits = dynamic + dynamic / 4 + 4 + check;
  return static_cast<double>(kNominalBits) / nominal_bit_rate_hz +
         static_cast<double>(data_bits) / data_bit_rate_hz;
}

std::vector<LinkLoad> can_bus_load(const CanSpec& spec, const CanLayout& layout,
                                   double sample_rate_hz) {
  std::vector<LinkLoad> loads;
  for (const CanBusSpec& bus : spec.buses) {
    const auto frame_s = [&](std::size_t payload) {
      return can_fd_frame_time_s(can_fd_length(kCanHeaderBytes + payload), bus.nominal_bit_rate_hz,
                                 bus.data_bit_rate_hz);
    };
    LinkLoad load;
    load.link = bus.interface;
    for (const std::vector<CanValueFrame>* list : {&layout.setpoints, &layout.sensors})
      for (const CanValueFrame& frame : *list)
        if (frame.bus == loads.size()) load.cycle_s += frame_s(frame.payload_bytes());
    const double other = loads.empty() ? frame_s(kCanStateBytes) * kCanHeartbeatRate_hz : 0.0;
    load.load = load.cycle_s * sample_rate_hz + other;
    load.most_hz = load.cycle_s > 0.0 ? (spec.largest_load - other) / load.cycle_s
                                      : std::numeric_limits<double>::infinity();
    loads.push_back(load);
  }
  return loads;
}

void require_bus_carries(const CanSpec& spec, const CanLayout& layout, double sample_rate_hz) {
  for (const LinkLoad& load : can_bus_load(spec, layout, sample_rate_hz))
    require(load.load <= spec.largest_load,
            "can: {} would have a load of {:.0f} % at {:g} Hz ({:.0f} us per cycle); the limit is "
            "{:.0f} %. Use at most {:.0f} Hz, more buses, or mode: resident",
            load.link, 100.0 * load.load, sample_rate_hz, 1e6 * load.cycle_s,
            100.0 * spec.largest_load, load.most_hz);
}

}  // namespace stageid
