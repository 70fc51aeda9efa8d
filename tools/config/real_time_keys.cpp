#include "tools/config/real_time_keys.hpp"

namespace stageid {

void describe_real_time(ConfigVisitor& visitor, RealTimeKeys& keys) {
  choose(visitor, "policy", keys.options.policy, kOptional,
         "try: warn about missing prerequisites; require: exit code 1 without the permissions or a "
         "PREEMPT_RT kernel");
  count(visitor, "priority", keys.options.priority, 1, 99, kOptional, "SCHED_FIFO priority");
  count(visitor, "cpu", keys.options.cpu, -1, 4095, kOptional,
        "processor that the loop is pinned to; -1: not pinned");
  std::size_t lock = keys.options.lock_memory ? 1 : 0;
  visitor.choice("lock_memory", lock, {"false", "true"}, kOptional,
                 "lock the memory so that it is never swapped");
  keys.options.lock_memory = lock == 1;
  visitor.number("jitter_s", keys.jitter_s, not_negative("s"), kOptional,
                 "on the wall clock, samples that are off by more are marked. 0: half a sample, "
                 "and 0.1 rad rms of phase at the highest excited frequency in a run");
  count(visitor, "misses_allowed", keys.misses_allowed, 0, 1'000'000, kOptional,
        "the run is stopped if a counter exceeds this value: +2 per bad cycle, -1 per good one, at "
        "least 0");
}

}  // namespace stageid
