#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "hal/can/can_layout.hpp"

namespace stageid {

/// Longest time that a CAN FD frame with an 11-bit identifier occupies the bus, with worst-case stuffing
/// and intermission:
///
///   t = (17 + 4 + 13) / f_nominal + (d + floor((d + 8 n) / 4) + 8 n + 4 + c + s) / f_data
///
/// 17 bits from SOF to BRS with 4 stuff bits, 13 from the CRC delimiter to the intermission; d = 5
/// bits (ESI, DLC), n bytes, 4 of the stuff count; a CRC of c = 17 bits with s = 6 fixed stuff bits
/// up to 16 bytes, 21 with 7 above. Source: ISO 11898-1:2015, frame format.
double can_fd_frame_time_s(std::size_t bytes, double nominal_bit_rate_hz, double data_bit_rate_hz);

/// Load of a connection of a stage that is measured sample by sample.
struct LinkLoad {
  std::string link;      ///< interface or address
  double load = 0.0;     ///< share of the available time, including state frames
  double cycle_s = 0.0;  ///< on the wire, per sample
  double most_hz = 0.0;  ///< the highest sample rate, at the largest permitted load
};

/// Load of the cyclic exchange at `sample_rate_hz`: every frame of the layout once per sample. The first
/// bus also carries the node's state ten times per second.
std::vector<LinkLoad> can_bus_load(const CanSpec& spec, const CanLayout& layout,
                                   double sample_rate_hz);

/// @throws std::invalid_argument with the computed loads if a bus would carry more than
/// spec.largest_load.
void require_bus_carries(const CanSpec& spec, const CanLayout& layout, double sample_rate_hz);

}  // namespace stageid
