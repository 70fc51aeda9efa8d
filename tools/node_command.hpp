#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>

#include "hal/stage_node.hpp"
#include "tools/console.hpp"
#include "tools/modbus_front.hpp"

namespace stageid {

/// stageid node CONFIG --modbus-tcp PORT | --modbus-rtu DEVICE
class NodeCommand {
 public:
  NodeCommand(CLI::App& app, Console& console);

 private:
  void run();

  Console& console_;
  std::filesystem::path config_;
  NodeOptions options_;
  ModbusFront modbus_;
};

}  // namespace stageid
