#include "acquisition/slog/slog_format.hpp"

#include "acquisition/slog/crc32c.hpp"

namespace stageid {

const char* to_string(SlogBlockType type) noexcept {
  switch (type) {
    case SlogBlockType::log:
      return "log";
    case SlogBlockType::run_begin:
      return "run_begin";
    case SlogBlockType::excitation:
      return "excitation";
    case SlogBlockType::samples:
      return "samples";
    case SlogBlockType::run_end:
      return "run_end";
    case SlogBlockType::end:
      return "end";
  }
  return "unknown";
}

std::uint32_t slog_header_crc(const SlogBlockHeader& header) noexcept {
  const auto bytes = std::as_bytes(std::span(&header, 1));
  return crc32c(bytes.first(offsetof(SlogBlockHeader, header_crc)));
}

bool slog_header_intact(const SlogBlockHeader& header) noexcept {
  return header.magic == kSlogMagic && header.header_crc == slog_header_crc(header);
}

}  // namespace stageid
