// Runs inputs of the fuzz targets: replay DIRECTORY, with a folder of files per target. A crash is the failure.

#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "tests/fuzz/targets.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  int count = 0;
  std::filesystem::path current;
  try {
    for (const auto& folder : std::filesystem::directory_iterator(argv[1])) {
      const stageid::fuzz::Target& target =
          stageid::fuzz::target(folder.path().filename().string());
      for (const auto& file : std::filesystem::directory_iterator(folder)) {
        current = file.path();
        std::ifstream stream(current, std::ios::binary);
        const std::vector<char> bytes(std::istreambuf_iterator<char>(stream), {});
        stageid::fuzz::run(target,
                           {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
        ++count;
      }
    }
  } catch (const std::exception& error) {
    std::printf("%s: %s\n", current.c_str(), error.what());
    return 1;
  }
  std::printf("%d inputs\n", count);
  return count > 0 ? 0 : 1;
}
