// For libFuzzer and AFL++: the environment variable STAGEID_FUZZ_TARGET names the target.

#include <cstdlib>
#include <functional>

#include "tests/fuzz/targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const stageid::fuzz::Target& target = [] {
    const char* name = std::getenv("STAGEID_FUZZ_TARGET");
    return std::cref(stageid::fuzz::target(name != nullptr ? name : ""));
  }();
  stageid::fuzz::run(target, {data, size});
  return 0;
}
