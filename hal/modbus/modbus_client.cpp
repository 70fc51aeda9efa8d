#include "hal/modbus/modbus_client.hpp"

#include <fmt/format.h>
#include <modbus/modbus.h>
#include <sys/socket.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <thread>

#include "excitation/words/require.hpp"
#include "hal/stage/pacer.hpp"
#include "hal/stage/stage.hpp"

namespace stageid {
namespace {

constexpr std::size_t kMostLateReplies = 16;

bool is_exception(int error) { return error >= EMBXILFUN && error <= EMBXGTAR; }

bool is_bad_reply(int error) { return error >= EMBBADCRC && error <= EMBBADSLAVE; }

}  // namespace

ModbusClient::ModbusClient(const ModbusAddress& address, const ModbusTiming& timing)
    : address_(address), timing_(timing), context_(make_modbus_context(address)) {
  require(timing.response_s >= 1e-3 && timing.response_s <= timing.worst_reply_s &&
              timing.worst_reply_s <= 3600.0,
          "modbus: invalid response_s {} s or worst_reply_s {} s; response_s must be at least "
          "0.001 s, and worst_reply_s at least response_s",
          timing.response_s, timing.worst_reply_s);
  const auto seconds = static_cast<std::uint32_t>(timing.response_s);
  modbus_set_response_timeout(context_.get(), seconds,
                              static_cast<std::uint32_t>(1e6 * (timing.response_s - seconds)));
  // The response timeout restarts at every group of bytes. With the byte timeout disabled, it becomes one
  // deadline for the whole reply.
  modbus_set_byte_timeout(context_.get(), 0, 0);
}

void ModbusClient::connect() {
  if (!try_connect()) throw StageError(describe(last_));
}

bool ModbusClient::try_connect() noexcept {
  if (connected_) return true;
  if (modbus_connect(context_.get()) != 0) {
    last_ = {LinkStatus::disconnected, errno};
    return false;
  }
  connected_ = true;
  last_ = {};
  discard();
  return connected_;
}

void ModbusClient::close() noexcept {
  if (connected_) modbus_close(context_.get());
  connected_ = false;
}

/// Makes a request that returns the number of registers read, or -1.
template <typename Request>
LinkStatus ModbusClient::transact(std::size_t wanted, Request request) noexcept {
  if (!connected_) {
    if (last_.status != LinkStatus::flooded) last_ = {LinkStatus::disconnected, ENOTCONN};
    return last_.status;
  }
  request_ns_ = monotonic_ns();
  errno = 0;
  const int done = request();
  const int error = done < 0 ? errno : 0;
  last_ = {LinkStatus::disconnected, error};
  if (done == static_cast<int>(wanted)) {
    last_.status = LinkStatus::ok;
  } else if (done >= 0 || is_bad_reply(error)) {
    last_.status = LinkStatus::corrupt;
  } else if (is_exception(error)) {
    last_.status = LinkStatus::refused;
  } else if (error == ETIMEDOUT) {
    last_.status = LinkStatus::timeout;
  } else {
    close();
  }
  return last_.status;
}

LinkStatus ModbusClient::exchange(int write_first, std::span<const std::uint16_t> written,
                                  int read_first, std::span<std::uint16_t> read) noexcept {
  return transact(read.size(), [&] {
    return modbus_write_and_read_registers(context_.get(), write_first,
                                           static_cast<int>(written.size()), written.data(),
                                           read_first, static_cast<int>(read.size()), read.data());
  });
}

LinkStatus ModbusClient::read(int first, std::span<std::uint16_t> registers) noexcept {
  return transact(registers.size(), [&] {
    return modbus_read_registers(context_.get(), first, static_cast<int>(registers.size()),
                                 registers.data());
  });
}

void ModbusClient::drain() noexcept {
  if (!connected_) return;
  const std::int64_t silent_ns = request_ns_ + std::llround(1e9 * timing_.worst_reply_s);
  std::this_thread::sleep_for(std::chrono::nanoseconds(silent_ns - monotonic_ns()));
  discard();
}

// libmodbus would read from a connection for as long as its peer sends.
void ModbusClient::discard() noexcept {
  if (address_.serial()) {
    modbus_flush(context_.get());
    return;
  }
  std::array<char, kMostLateReplies * MODBUS_TCP_MAX_ADU_LENGTH> bytes{};
  const ssize_t count =
      ::recv(modbus_get_socket(context_.get()), bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (count < static_cast<ssize_t>(bytes.size())) return;
  close();
  last_ = {LinkStatus::flooded, 0};
}

bool ModbusClient::refused_as_busy() const noexcept {
  return last_.status == LinkStatus::refused && last_.error == EMBXSBUSY;
}

std::string ModbusClient::describe(const Trouble& trouble) const {
  const auto line = [this](const std::string& what) {
    return fmt::format("{}: {}", to_string(address_), what);
  };
  switch (trouble.status) {
    case LinkStatus::ok:
      return line("no error");
    case LinkStatus::timeout:
      return line(fmt::format(
          "no reply within {:.4g} s; check that the server is running and that the unit is correct",
          timing_.response_s));
    case LinkStatus::corrupt:
      return line(fmt::format("a reply was corrupt: {}", modbus_strerror(trouble.error)));
    case LinkStatus::refused:
      return line(fmt::format("refused: {}", modbus_strerror(trouble.error)));
    case LinkStatus::disconnected:
      return line(fmt::format("not connected: {}; check that the server is running",
                              modbus_strerror(trouble.error)));
    case LinkStatus::flooded:
      return line(
          "the peer sends more than it is asked for; check that it is a Modbus server and works");
  }
  return line("unknown error");
}

}  // namespace stageid
