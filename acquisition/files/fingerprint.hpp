#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace stageid {

/// XXH3-128 of a stream of bytes: identifies inputs in outputs. Not a protection against forgery.
class Fingerprint {
 public:
  Fingerprint();
  ~Fingerprint();
  Fingerprint(Fingerprint&&) noexcept;
  Fingerprint& operator=(Fingerprint&&) noexcept;

  void add(std::span<const std::byte> bytes);
  void add(std::string_view text);
  std::string hex() const;  ///< 32 hexadecimal digits

 private:
  struct State;
  std::unique_ptr<State> state_;
};

std::string fingerprint_of(std::string_view text);
/// @throws FileError
std::string fingerprint_of_file(const std::filesystem::path& file);

}  // namespace stageid
