#include "hal/can/can_transport.hpp"

namespace stageid {

WorstBus worst_bus(const CanTransport& transport) noexcept {
  WorstBus worst;
  for (std::size_t bus = 0; bus < transport.buses(); ++bus)
    if (transport.health(bus).state > worst.state) worst = {transport.health(bus).state, bus};
  return worst;
}

}  // namespace stageid
