#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "hal/modbus/modbus_address.hpp"

namespace stageid {

/// Result of a transaction.
enum class LinkStatus : std::uint8_t {
  ok,
  timeout,       ///< no complete reply within the response time
  corrupt,       ///< the reply failed a check: CRC, length, transaction, unit
  refused,       ///< an exception reply
  disconnected,  ///< the peer or the device is gone
  flooded        ///< disconnected, because the peer never stopped sending
};

/// A Modbus client for one unit over TCP or RTU. Not safe for concurrent use.
///
/// After any failure except a refusal, call drain() before the next transaction. Replies on a serial line have
/// no number. A late one would be taken for the answer to the next request, and so would all that follow.
/// drain() waits until no more replies can arrive and discards the received ones. If there are too many of them, it
/// ends the connection.
class ModbusClient {
 public:
  /// @throws std::invalid_argument if the address is refused or the times are invalid
  /// (0 < response_s <= worst_reply_s).
  ModbusClient(const ModbusAddress& address, const ModbusTiming& timing);

  /// Does nothing if connected. @throws StageError if the connection fails.
  void connect();
  bool try_connect() noexcept;
  bool connected() const noexcept { return connected_; }
  void close() noexcept;

  /// One function 23: writes, then reads. Does not allocate or throw.
  [[nodiscard]] LinkStatus exchange(int write_first, std::span<const std::uint16_t> written,
                                    int read_first, std::span<std::uint16_t> read) noexcept;
  /// One function 3, up to 125 registers.
  [[nodiscard]] LinkStatus read(int first, std::span<std::uint16_t> registers) noexcept;

  void drain() noexcept;
  /// Makes a request, and again after a drain if it fails.
  template <typename Request>
  LinkStatus repeat_once(Request request) {
    if (const LinkStatus done = request(); done == LinkStatus::ok) return done;
    drain();
    return request();
  }

  const ModbusAddress& address() const noexcept { return address_; }
  const ModbusTiming& timing() const noexcept { return timing_; }
  struct Trouble {
    LinkStatus status = LinkStatus::ok;
    int error = 0;  ///< errno, including libmodbus' own values
  };
  const Trouble& last() const noexcept { return last_; }
  /// Whether the last request was refused because the device is busy (exception 6).
  bool refused_as_busy() const noexcept;
  /// Text for the user: "Modbus TCP 127.0.0.1:502, unit 1: no reply within 0.2 s".
  std::string describe(const Trouble& trouble) const;

 private:
  void discard() noexcept;
  template <typename Request>
  LinkStatus transact(std::size_t wanted, Request request) noexcept;

  ModbusAddress address_;
  ModbusTiming timing_;
  ModbusContext context_;
  bool connected_ = false;
  Trouble last_;
  std::int64_t request_ns_ = 0;
};

}  // namespace stageid
