#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "hal/modbus/modbus_client.hpp"
#include "hal/modbus/modbus_encoding.hpp"
#include "hal/stage/supervisor.hpp"

namespace stageid {

struct ModbusSupervisorOptions {
  double poll_period_s = 0.1;      ///< 10-20 Hz over TCP, 5-10 Hz over RTU
  double backoff_first_s = 0.1;    ///< before the second attempt to connect; then doubled
  double backoff_longest_s = 5.0;  ///< upper bound of the doubled delay
};

/// The supervisor behind Modbus. A separate thread polls with one function 23 (heartbeat and command out,
/// status in), because timeouts, drains and reconnections take time.
///
/// A poll is valid only if the status has the map's magic and version and echoes one of the last kEchoPolls
/// heartbeats. The echo proves that the program behind the server runs, not only its network card. A failed
/// poll is drained and repeated once; then the link is closed and reopened.
class ModbusSupervisor final : public Supervisor {
 public:
  static constexpr std::uint32_t kEchoPolls = 2;  // a PLC may copy the heartbeat one scan later

  /// Starts the thread; snapshot() shows whether the peer answers.
  /// @throws std::invalid_argument if an address, a time or the poll period is invalid.
  ModbusSupervisor(const ModbusAddress& address, const ModbusTiming& timing,
                   const ModbusSupervisorOptions& options = {});

  PlantSnapshot snapshot() const override;
  SupervisorReply request(SupervisorCommand command) override;
  std::string trouble() const override;

 private:
  void run(const std::stop_token& stop);
  bool connect();
  bool poll();
  LinkStatus transact(std::span<std::uint16_t> status);
  bool take_status(RegisterBlock<const std::uint16_t> status);
  void set_trouble(std::string trouble);

  ModbusClient link_;
  ModbusSupervisorOptions options_;
  std::uint32_t heartbeat_ = 0;
  std::uint32_t command_ = 0;
  std::uint32_t command_sequence_ = 0;

  std::mutex request_mutex_;  // one request at a time
  mutable std::mutex mutex_;  // guards all members below
  std::condition_variable_any changed_;
  PlantSnapshot snapshot_;
  std::string trouble_;
  std::optional<SupervisorCommand> wanted_;
  bool sent_ = false;  // wanted_ has its sequence number
  std::optional<SupervisorReply> reply_;
  std::jthread thread_;  // last: it uses all other members
};

}  // namespace stageid
