#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/modbus/modbus_link.hpp"
#include "hal/modbus/modbus_session.hpp"
#include "hal/stage/pacer.hpp"
#include "hal/stage/peer_status.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

struct ModbusHostOptions {
  double pace = 0.0;         ///< see Pacer
  bool reset_fault = false;  ///< clear a fault of the node at the first start()
};

/// Seconds that one sample of the stage takes on the wire: setpoints out, measurements in.
double modbus_exchange_s(const ModbusAddress& address, const ModbusTiming& timing,
                         const StageInfo& info);

/// A stage behind Modbus, one function 23 a sample: u[n] out, y[n+1] in. For low rates: what one
/// transaction takes is computed, and a faster stage is refused.
///
/// Every measurement echoes the sequence number of its setpoint and the boot id of the node, so that
/// a late, old or foreign reply is never taken for the answer. An exchange whose reply is missing or
/// fails a check is drained and repeated once with the same number, which moves nothing twice:
/// Outcome::late if that helps, otherwise link_down (no reply), corrupt or fault (refused), within
/// 2 worst_reply_s. What the node says of itself has the meaning that peer_status.hpp gives it.
///
/// start() enables the stage if nobody has, and stop() disables it only then.
class ModbusStage final : public CyclicStage {
 public:
  /// Nothing is sent. `info`: names, rate, transport delay.
  /// @throws std::invalid_argument if the link cannot carry info.sample_rate_hz or the channels; the
  /// message tells the computed transaction time.
  ModbusStage(StageInfo info, const ModbusAddress& address, const ModbusTiming& timing,
              const ModbusHostOptions& options = {});

  const StageInfo& info() const noexcept override { return info_; }
  /// @throws StageError also if another stage is found there, or one that another program measures.
  void start(std::uint64_t run_seed, Inputs& first) override;
  [[nodiscard]] Outcome exchange(const Outputs& outputs, Inputs& inputs,
                                 Deadline deadline) noexcept override;
  void stop() noexcept override;
  std::string trouble() const override;

 private:
  void end_run();
  bool write_setpoint(const Outputs& outputs) noexcept;
  PeerStatus transact() noexcept;
  bool restarted() noexcept;
  PeerStatus judge(LinkStatus status) noexcept;
  PeerStatus judge_reply() noexcept;
  PeerStatus take_measurement(Inputs& inputs) noexcept;
  std::uint32_t measured(int address) const noexcept;

  StageInfo info_;
  ModbusLink link_;
  Pacer pacer_;
  std::vector<std::uint16_t> request_;  // setpoint block
  std::vector<std::uint16_t> reply_;    // measurement block
  ModbusDescription description_;
  std::uint32_t session_ = 0;
  std::uint32_t sequence_ = 0;
  std::uint32_t missed_ = 0;  // setpoints of this run, as the node counts them
  bool running_ = false;
  bool enabled_here_ = false;
  bool reset_fault_;

  /// What the last exchange ran into; text is made of it when somebody asks.
  enum class Trouble : std::uint8_t { none, link, foreign_reply, node, not_carried };
  Trouble trouble_ = Trouble::none;
  PeerStatus status_ = PeerStatus::good;
  ModbusLink::Trouble link_trouble_;
  std::uint32_t node_status_ = 0;
};

}  // namespace stageid
