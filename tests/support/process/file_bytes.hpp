#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "acquisition/files/input_files.hpp"

namespace stageid::test {

inline std::string read_bytes(const std::filesystem::path& file) { return read_whole_file(file); }

inline void write_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

}  // namespace stageid::test
