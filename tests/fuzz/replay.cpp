// Runs inputs of the fuzz targets and simple mutations of them, always the same ones. A crash is the failure.
//   fuzz_replay MUTATIONS DIRECTORY...     each with a folder of files per target
// If STAGEID_FUZZ_LAST names a file, it holds the input that is running, for a look at a crash.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "tests/fuzz/targets.hpp"

namespace {

namespace fs = std::filesystem;
using Input = std::vector<std::uint8_t>;

Input content(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(stream), {});
  return {bytes.begin(), bytes.end()};
}

Input mutated(Input input, std::mt19937_64& random) {
  if (input.empty()) return input;
  for (std::uint64_t change = 1 + random() % 8; change > 0; --change) {
    const std::size_t at = random() % std::min<std::size_t>(input.size(), 1 + random() % 100'000);
    const auto piece = static_cast<std::ptrdiff_t>(std::min(random() % 32, input.size() - at));
    const auto place = input.begin() + at;
    switch (random() % 8) {
      case 0:
        input.erase(place, place + piece);
        break;
      case 1: {
        const Input copy(place, place + piece);
        input.insert(place, copy.begin(), copy.end());
        break;
      }
      case 2:
        std::fill(place, place + piece, static_cast<std::uint8_t>(random() % 2 * 255));
        break;
      default:
        *place = static_cast<std::uint8_t>(random());
    }
    if (input.empty()) break;
  }
  if (random() % 16 == 0) input.resize(random() % (input.size() + 1));
  return input;
}

void run(const stageid::fuzz::Target& target, const Input& input) {
  static const char* const last = std::getenv("STAGEID_FUZZ_LAST");
  if (last != nullptr)
    std::ofstream(last, std::ios::binary)
        .write(reinterpret_cast<const char*>(input.data()),
               static_cast<std::streamsize>(input.size()));
  stageid::fuzz::run(target, input);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const int mutations = std::atoi(argv[1]);
  long count = 0;
  fs::path current;
  try {
    for (int k = 2; k < argc; ++k) {
      if (!fs::exists(argv[k])) continue;
      for (const auto& folder : fs::directory_iterator(argv[k])) {
        const auto start = std::chrono::steady_clock::now();
        const std::string name = folder.path().filename().string();
        const stageid::fuzz::Target& target = stageid::fuzz::target(name);
        for (const auto& file : fs::directory_iterator(folder)) {
          current = file.path();
          const Input input = content(current);
          std::mt19937_64 random(input.size());
          run(target, input);
          for (int n = 0; n < mutations; ++n) run(target, mutated(input, random));
          count += 1 + mutations;
        }
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
        std::printf("%-12s %6.2f s\n", name.c_str(), seconds.count());
        std::fflush(stdout);
      }
    }
  } catch (const std::exception& error) {
    std::printf("%s: %s\n", current.c_str(), error.what());
    return 1;
  }
  std::printf("%ld inputs\n", count);
  return count > 0 ? 0 : 1;
}
