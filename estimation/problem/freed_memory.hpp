#pragma once

namespace stageid {

/// Keeps up to 64 MiB of freed memory in the process; blocks of 32 MiB and more are still returned at once. Each
/// iteration frees and allocates some MiB; returned to the kernel in between, every page is zeroed and mapped again, a
/// quarter of the time of a refined-IV iteration on 3960 lines. Affects the whole process; call it before threads
/// start. Source: mallopt(3).
void keep_freed_memory();

}  // namespace stageid
