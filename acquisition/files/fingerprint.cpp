#include "acquisition/files/fingerprint.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <xxhash.h>

#include <cerrno>
#include <new>

#include "acquisition/files/fail.hpp"
#include "acquisition/files/file_descriptor.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {

void Fingerprint::Free::operator()(XXH3_state_s* state) const noexcept { XXH3_freeState(state); }

Fingerprint::Fingerprint() : state_(XXH3_createState()) {
  if (!state_) throw std::bad_alloc();
  XXH3_128bits_reset(state_.get());
}

void Fingerprint::add(std::span<const std::byte> bytes) {
  if (!bytes.empty()) XXH3_128bits_update(state_.get(), bytes.data(), bytes.size());
}

void Fingerprint::add(std::string_view text) { add(std::as_bytes(std::span(text))); }

std::string Fingerprint::hex() const {
  // The canonical form has the same byte order on every machine.
  XXH128_canonical_t canonical;
  XXH128_canonicalFromHash(&canonical, XXH3_128bits_digest(state_.get()));
  return fmt::format("{:02x}", fmt::join(canonical.digest, ""));
}

std::string fingerprint_of(std::string_view text) {
  Fingerprint fingerprint;
  fingerprint.add(text);
  return fingerprint.hex();
}

std::string fingerprint_of_file(const std::filesystem::path& file) {
  const FileDescriptor descriptor(::open(file.c_str(), O_RDONLY | O_CLOEXEC));
  Fingerprint fingerprint;
  const auto add = [&](std::string_view piece) { fingerprint.add(piece); };
  if (!descriptor || !read_pieces(descriptor, add))
    fail_file(file, "cannot be read: {}", system_reason(errno));
  return fingerprint.hex();
}

}  // namespace stageid
