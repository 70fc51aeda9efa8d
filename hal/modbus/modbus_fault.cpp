#include "hal/modbus/modbus_fault.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace stageid {
namespace {

[[noreturn]] void refuse(std::string_view text, const std::string& what) {
  throw std::invalid_argument(
      fmt::format("fault '{}': {}; expected KIND[@REQUEST][xCOUNT][:VALUE]", text, what));
}

/// Removes the text from `separator` on and returns the part after it; empty if there is none.
std::string_view cut(std::string_view& text, char separator) {
  const std::size_t at = text.find(separator);
  if (at == std::string_view::npos) return {};
  const std::string_view behind = text.substr(at + 1);
  text = text.substr(0, at);
  return behind;
}

template <typename Number>
Number parse(std::string_view whole, std::string_view text, const char* name) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size())
    refuse(whole, fmt::format("{} '{}' is not a number", name, text));
  return value;
}

bool needs_value(ModbusFault::Kind kind) {
  using Kind = ModbusFault::Kind;
  return kind == Kind::late_reply || kind == Kind::exception || kind == Kind::temperature ||
         kind == Kind::gravity;
}

void check_value(std::string_view whole, const ModbusFault& fault) {
  using Kind = ModbusFault::Kind;
  if (!std::isfinite(fault.value)) refuse(whole, "VALUE must be finite");
  if (fault.kind == Kind::late_reply && !(fault.value > 0.0 && fault.value <= 60.0))
    refuse(whole, "VALUE must be above 0 and at most 60 s");
  if (fault.kind == Kind::exception && !(fault.value >= 1.0 && fault.value <= 11.0))
    refuse(whole, "VALUE must be an exception code from 1 to 11");
}

}  // namespace

ModbusFault parse_modbus_fault(std::string_view text) {
  using Kind = ModbusFault::Kind;
  std::string_view rest = text;
  const bool has_value = rest.find(':') != std::string_view::npos;
  const std::string_view value = cut(rest, ':');
  const bool has_place = rest.find('@') != std::string_view::npos;
  std::string_view place = cut(rest, '@');
  const std::string_view count = cut(place, 'x');
  ModbusFault fault;
  const std::optional<Kind> kind = from_word<Kind>(rest);
  if (!kind)
    refuse(text,
           fmt::format("unknown kind '{}', allowed are {}", rest, fmt::join(kWords<Kind>, ", ")));
  fault.kind = *kind;
  fault.count = *kind >= Kind::dead_server ? 0 : 1;
  if (has_place) fault.from = parse<std::uint64_t>(text, place, "REQUEST");
  if (fault.from == 0) refuse(text, "REQUEST must be 1 or more");
  if (!count.empty()) fault.count = parse<std::uint64_t>(text, count, "COUNT");
  if (has_value != needs_value(*kind))
    refuse(text, has_value ? "this kind has no VALUE" : "this kind needs a VALUE");
  if (has_value) fault.value = parse<double>(text, value, "VALUE");
  check_value(text, fault);
  return fault;
}

ModbusFaultScript::ModbusFaultScript(std::vector<ModbusFault> faults)
    : faults_(std::move(faults)) {}

const ModbusFault* ModbusFaultScript::active(ModbusFault::Kind kind) const noexcept {
  for (const ModbusFault& fault : faults_) {
    const bool begun = fault.kind == kind && request_ >= fault.from;
    if (begun && (fault.count == 0 || request_ - fault.from < fault.count)) return &fault;
  }
  return nullptr;
}

bool ModbusFaultScript::mentions(ModbusFault::Kind kind) const noexcept {
  return std::any_of(faults_.begin(), faults_.end(),
                     [kind](const ModbusFault& fault) { return fault.kind == kind; });
}

}  // namespace stageid
