#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stageid {

/// Settings of the computer that delay a real-time loop, with their remedies, one line each: the frequency governor,
/// deep idle states, a processor that other programs or interrupts share. Nothing is reported that /sys and /proc
/// do not contain, as in a virtual machine.
///
/// @param cpu processor of the loop; -1: not pinned, so the governor and idle states of all processors count
/// @param root contains sys and proc
std::vector<std::string> real_time_obstacles(int cpu, const std::filesystem::path& root = "/");

}  // namespace stageid
