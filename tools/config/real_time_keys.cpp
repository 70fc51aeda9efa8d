#include "tools/config/real_time_keys.hpp"

namespace stageid {

void describe_real_time(ConfigVisitor& visitor, RealTimeKeys& keys) {
  choose(visitor, "policy", keys.options.policy, {"off", "try", "require"}, kOptional,
         "try: warn of what is missing; require: exit 1 without rights or a PREEMPT_RT kernel");
  count(visitor, "priority", keys.options.priority, 1, 99, kOptional, "of SCHED_FIFO");
  count(visitor, "cpu", keys.options.cpu, -1, 4095, kOptional,
        "processor the loop is pinned to; -1: none in particular");
  std::size_t lock = keys.options.lock_memory ? 1 : 0;
  visitor.choice("lock_memory", lock, {"false", "true"}, kOptional, "keep it out of the swap");
  keys.options.lock_memory = lock == 1;
  count(visitor, "misses_allowed", keys.misses_allowed, 0, 1'000'000, kOptional,
        "leaky bucket: +2 a bad cycle, -1 a good one, above it a controlled stop");
}

}  // namespace stageid
