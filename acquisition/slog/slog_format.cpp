#include "acquisition/slog/slog_format.hpp"

#include "acquisition/slog/crc32c.hpp"

namespace stageid {

std::uint32_t slog_header_crc(const SlogBlockHeader& header) noexcept {
  const auto bytes = std::as_bytes(std::span(&header, 1));
  return crc32c(bytes.first(offsetof(SlogBlockHeader, header_crc)));
}

bool slog_header_intact(const SlogBlockHeader& header) noexcept {
  return header.magic == kSlogMagic && header.header_crc == slog_header_crc(header);
}

}  // namespace stageid
