#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <span>

#include "hal/modbus/modbus_answer.hpp"

namespace stageid::test {

/// Accepts everything.
struct NoRegisters : ModbusRegisters {
  void begin_request(ModbusConnection) override {}
  void tick() override {}
  ModbusException write(int, std::span<const std::uint16_t>) override { return {}; }
  ModbusException read(int, std::span<std::uint16_t>) override { return {}; }
};

/// Passes everything on. Another thread may exchange the registers.
struct RegistersThrough : ModbusRegisters {
  explicit RegistersThrough(ModbusRegisters& registers) : inner(&registers) {}
  void begin_request(ModbusConnection from) override { inner.load()->begin_request(from); }
  void tick() override { inner.load()->tick(); }
  ModbusException write(int first, std::span<const std::uint16_t> values) override {
    return inner.load()->write(first, values);
  }
  ModbusException read(int first, std::span<std::uint16_t> values) override {
    return inner.load()->read(first, values);
  }
  std::atomic<ModbusRegisters*> inner;
};

/// 130 registers, each with its own number as value.
class NumberedRegisters final : public ModbusRegisters {
 public:
  NumberedRegisters() {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<std::uint16_t>(i);
  }
  void begin_request(ModbusConnection) override { ++requests; }
  void tick() override {}
  ModbusException write(int first, std::span<const std::uint16_t> written) override {
    if (!inside(first, written.size())) return ModbusException::illegal_address;
    std::copy(written.begin(), written.end(), values.begin() + first);
    return ModbusException::none;
  }
  ModbusException read(int first, std::span<std::uint16_t> out) override {
    if (!inside(first, out.size())) return ModbusException::illegal_address;
    std::copy_n(values.begin() + first, out.size(), out.begin());
    return ModbusException::none;
  }
  std::array<std::uint16_t, 130> values{};
  int requests = 0;

 private:
  bool inside(int first, std::size_t count) const {
    return first >= 0 && static_cast<std::size_t>(first) + count <= values.size();
  }
};

}  // namespace stageid::test
