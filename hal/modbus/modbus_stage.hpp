#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "hal/modbus/modbus_client.hpp"
#include "hal/modbus/modbus_session.hpp"
#include "hal/stage/pacer.hpp"
#include "hal/stage/peer_status.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {

struct ModbusHostOptions {
  double pace = 0.0;         ///< see Pacer
  bool reset_fault = false;  ///< clears a fault of the node at the first start()
};

/// Duration of the exchange of one sample in seconds: setpoints out, measurements in.
double modbus_exchange_s(const ModbusAddress& address, const ModbusTiming& timing,
                         const StageInfo& info);

/// A stage behind Modbus, one function 23 per sample: u[n] out, y[n+1] in. It is meant for low rates: if the
/// computed transaction time exceeds the sample period, the stage is refused.
///
/// Every measurement echoes the sequence number of its setpoint and the boot id of the node. A late, old or
/// foreign reply is therefore never taken for the answer. An exchange whose reply is missing or invalid is
/// drained and repeated once with the same number, which does not advance the stage twice. The outcome is
/// `late` if that succeeds, otherwise `link_down` (no reply), `corrupt` or `fault` (refused), within
/// 2 worst_reply_s. peer_status.hpp defines the meaning of the node's states.
///
/// start() enables the stage if necessary; only then does stop() disable it.
class ModbusStage final : public CyclicStage {
 public:
  /// Sends nothing. `info`: names, rate, transport delay.
  /// @throws std::invalid_argument if the link is too slow for info.sample_rate_hz or cannot carry the
  /// channels; the message contains the computed transaction time.
  ModbusStage(StageInfo info, const ModbusAddress& address, const ModbusTiming& timing,
              const ModbusHostOptions& options = {});

  const StageInfo& info() const noexcept override { return info_; }
  /// @throws StageError also if another stage answers, or if another program is measuring.
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
  RegisterBlock<const std::uint16_t> measured() const noexcept;
  std::string describe_report(PeerStatus status, std::uint32_t node_status) const;

  StageInfo info_;
  ModbusClient link_;
  Pacer pacer_;
  std::vector<std::uint16_t> request_;  // setpoint block
  std::vector<std::uint16_t> reply_;    // measurement block
  ModbusDescription description_;
  std::uint32_t session_ = 0;
  std::uint32_t sequence_ = 0;
  std::uint32_t missed_ = 0;  // missed setpoints of this run, counted by the node
  bool running_ = false;
  bool enabled_here_ = false;
  bool reset_fault_;

  /// Problem of the last exchange; trouble() formats it on request.
  enum class Trouble : std::uint8_t { none, link, foreign_reply, node, not_carried };
  Trouble trouble_ = Trouble::none;
  PeerStatus status_ = PeerStatus::good;
  ModbusClient::Trouble link_trouble_;
  std::uint32_t node_status_ = 0;
  // The report of the node that stopped the run; it may be good again while the excitation is ramped down.
  PeerStatus stopped_by_ = PeerStatus::good;
  std::uint32_t node_status_at_stop_ = 0;
};

}  // namespace stageid
