#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "hal/node/stage_node.hpp"
#include "tools/config/stage_config.hpp"
#include "tools/measure/modbus_front.hpp"
#include "tools/terminal/console.hpp"

namespace stageid {

/// stageid node STAGE --can IF | --modbus-tcp PORT | --modbus-rtu DEVICE
///
/// One StageNode with one front end per requested kind of connection.
class NodeCommand {
 public:
  NodeCommand(CLI::App& app, Console& console);

 private:
  void run();
  StageNode make_node(const StageConfig& config) const;
  double watchdog_s(const StageConfig& config) const;
  void serve_can(const StageConfig& config, StageNode& node) const;

  Console& console_;
  std::filesystem::path config_;
  std::vector<std::string> can_interfaces_;
  std::vector<std::string> can_faults_;
  double pace_ = 0.0;
  double hold_s_ = 0.1;
  double watchdog_s_ = 0.0;
  ModbusFront modbus_;
};

}  // namespace stageid
