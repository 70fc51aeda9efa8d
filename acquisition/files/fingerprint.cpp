#include "acquisition/files/fingerprint.hpp"

#include <xxhash.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <new>
#include <vector>

#include "acquisition/files/file_error.hpp"
#include "acquisition/files/system_reason.hpp"

namespace stageid {

struct Fingerprint::State {
  struct Free {
    void operator()(XXH3_state_t* state) const noexcept { XXH3_freeState(state); }
  };
  std::unique_ptr<XXH3_state_t, Free> hash{XXH3_createState()};
};

Fingerprint::Fingerprint() : state_(std::make_unique<State>()) {
  if (!state_->hash) throw std::bad_alloc();
  XXH3_128bits_reset(state_->hash.get());
}
Fingerprint::~Fingerprint() = default;
Fingerprint::Fingerprint(Fingerprint&&) noexcept = default;
Fingerprint& Fingerprint::operator=(Fingerprint&&) noexcept = default;

void Fingerprint::add(std::span<const std::byte> bytes) {
  if (!bytes.empty()) XXH3_128bits_update(state_->hash.get(), bytes.data(), bytes.size());
}

void Fingerprint::add(std::string_view text) { add(std::as_bytes(std::span(text))); }

std::string Fingerprint::hex() const {
  // The canonical form has the same byte order on every machine.
  XXH128_canonical_t canonical;
  XXH128_canonicalFromHash(&canonical, XXH3_128bits_digest(state_->hash.get()));
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const unsigned char byte : canonical.digest) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 0xF];
  }
  return text;
}

std::string fingerprint_of(std::string_view text) {
  Fingerprint fingerprint;
  fingerprint.add(text);
  return fingerprint.hex();
}

std::string fingerprint_of_file(const std::filesystem::path& file) {
  struct Close {
    void operator()(std::FILE* stream) const noexcept { std::fclose(stream); }
  };
  const auto fail = [&file](int error) {
    throw FileError(file.string() + ": cannot be read: " + system_reason(error));
  };
  const std::unique_ptr<std::FILE, Close> stream(std::fopen(file.c_str(), "rb"));
  if (!stream) fail(errno);

  constexpr std::size_t kBlock = std::size_t{1} << 20;
  std::vector<std::byte> block(kBlock);
  Fingerprint fingerprint;
  std::size_t count = 0;
  while ((count = std::fread(block.data(), 1, block.size(), stream.get())) > 0) {
    fingerprint.add(std::span(block).first(count));
  }
  if (std::ferror(stream.get()) != 0) fail(errno);
  return fingerprint.hex();
}

}  // namespace stageid
