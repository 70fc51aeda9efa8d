#pragma once

#include <gmock/gmock.h>

#include <cctype>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/stages/simulated_spec.hpp"

namespace stageid::test {

/// Of a call: it throws this error with this text.
template <typename Error = StageError>
auto refuses(const std::string& text) {
  return testing::ThrowsMessage<Error>(testing::HasSubstr(text));
}

/// Waits for an event; ten seconds allow for a busy machine.
inline bool comes(const std::function<bool()>& condition) {
  for (int i = 0; i < 2000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return false;
}

/// A text as the name of a test.
inline std::string test_name(std::string text) {
  for (char& c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  return text;
}

/// Exchanges with a stage in open loop; commands and measurements are accessible.
class Driver {
 public:
  explicit Driver(CyclicStage& stage)
      : u(stage.info().actuators.size()), y(stage.info().sensors.size()), stage_(stage) {
    inputs.y = y;
  }
  Driver(Driver&&) = delete;
  void start(std::uint64_t run_seed = 1) { stage_.start(run_seed, inputs); }
  Outcome step(Deadline deadline = {}) {
    return stage_.exchange({inputs.cycle, u}, inputs, deadline);
  }

  std::vector<double> u;
  std::vector<double> y;
  Inputs inputs;

 private:
  CyclicStage& stage_;
};

struct OwnSimulatedStage {
  std::unique_ptr<SimulatedStage> own;
};

struct Bench : private OwnSimulatedStage, Driver {
  explicit Bench(const SimulatedSpec& spec) : OwnSimulatedStage{simulated(spec)}, Driver(*own) {}
  SimulatedStage& stage() { return *own; }
};

}  // namespace stageid::test
