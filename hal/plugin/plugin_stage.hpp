#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hal/stage/stage.hpp"

namespace stageid {

/// A back end in a shared library, and the free keys that it receives.
struct PluginSpec {
  std::filesystem::path library;
  std::vector<std::pair<std::string, std::string>> keys;
};

/// A stage behind a shared library with the C interface of stageid_backend.h.
///
/// The library determines the clock; rate and channels are those of `info`. An unknown outcome is a fault.
/// LimitedStage handles measurements that are not finite.
class PluginStage final : public CyclicStage {
 public:
  /// @param pace as in the stage file; 0: virtual time
  /// @throws StageError if the library cannot be loaded, has another version, lacks a function or cannot
  /// connect, or if the stage is slower than the sample rate.
  PluginStage(StageInfo info, const PluginSpec& spec, double pace);
  ~PluginStage() override;

  const StageInfo& info() const noexcept override { return info_; }
  void start(std::uint64_t run_seed, Inputs& first) override;
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override;
  void stop() noexcept override;
  std::string trouble() const override;

 private:
  struct Library;

  StageInfo info_;
  std::unique_ptr<Library> library_;
};

}  // namespace stageid
