#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "hal/stage/stage.hpp"

namespace stageid {

/// Where a back end of others is, and the free keys that it is given.
struct PluginSpec {
  std::filesystem::path library;
  std::vector<std::pair<std::string, std::string>> keys;
};

/// A stage behind a shared library with the C interface of stageid_backend.h.
///
/// The library decides the clock; its rate and channels are those of `info`. What it returns is checked:
/// an outcome that does not exist is a fault, and measurements that are not numbers count as missing.
class PluginStage final : public CyclicStage {
 public:
  /// @param pace as in the stage file; 0: virtual time
  /// @throws StageError if the library cannot be loaded, is of another version, lacks a function, cannot
  /// connect, or the stage is slower than the sample rate.
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
