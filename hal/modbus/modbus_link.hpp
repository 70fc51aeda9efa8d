#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "hal/modbus/modbus_context.hpp"
#include "hal/modbus/modbus_wire.hpp"

namespace stageid {

/// How a transaction ended.
enum class LinkStatus : std::uint8_t {
  ok,
  timeout,      ///< no whole reply within the response time
  corrupt,      ///< the reply failed a check: CRC, length, transaction, unit
  refused,      ///< an exception reply
  disconnected  ///< the peer or the device is gone
};

/// A Modbus client for one unit over TCP or RTU. One thread at a time.
///
/// After any failure but a refusal call drain() before the next transaction: on a serial line a reply
/// has no number, so that one that comes late would be taken for the answer to the next request, and
/// so for ever. drain() waits until no reply can come any more and throws away what has come.
class ModbusLink {
 public:
  /// @throws std::invalid_argument if the address is refused or the times make no sense
  /// (0 < response_s <= worst_reply_s).
  ModbusLink(const ModbusAddress& address, const ModbusTiming& timing);

  /// Does nothing if connected. @throws StageError if nobody is there.
  void connect();
  bool try_connect() noexcept;
  bool connected() const noexcept { return connected_; }
  void close() noexcept;

  /// One function 23: writes, then reads. Neither allocates nor throws.
  [[nodiscard]] LinkStatus exchange(int write_first, std::span<const std::uint16_t> written,
                                    int read_first, std::span<std::uint16_t> read) noexcept;
  /// One function 3, up to 125 registers.
  [[nodiscard]] LinkStatus read(int first, std::span<std::uint16_t> registers) noexcept;

  void drain() noexcept;

  const ModbusAddress& address() const noexcept { return address_; }
  const ModbusTiming& timing() const noexcept { return timing_; }
  struct Trouble {
    LinkStatus status = LinkStatus::ok;
    int error = 0;  ///< errno, libmodbus' own values included
  };
  const Trouble& last() const noexcept { return last_; }
  /// The last request was refused because the device is busy (exception 6).
  bool refused_as_busy() const noexcept;
  /// For people: "Modbus TCP 127.0.0.1:502, unit 1: no reply within 0.2 s".
  std::string describe(const Trouble& trouble) const;

 private:
  void begin() noexcept;
  LinkStatus not_connected() noexcept;
  LinkStatus judge(int done, std::size_t wanted) noexcept;

  ModbusAddress address_;
  ModbusTiming timing_;
  ModbusContext context_;
  bool connected_ = false;
  Trouble last_;
  std::int64_t request_ns_ = 0;
};

}  // namespace stageid
