#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "hal/stage_node.hpp"
#include "tools/console.hpp"
#include "tools/stage_config.hpp"

namespace stageid {

/// stageid node STAGE --can IF
///
/// One StageNode, and one front end for every kind of wire that was asked for.
class NodeCommand {
 public:
  NodeCommand(CLI::App& app, Console& console);

 private:
  void run() const;
  void serve_can(const StageConfig& config, StageNode& node) const;

  Console& console_;
  std::filesystem::path config_;
  std::vector<std::string> can_interfaces_;
  std::vector<std::string> can_faults_;
  double pace_ = 0.0;
  double hold_s_ = 0.1;
};

}  // namespace stageid
